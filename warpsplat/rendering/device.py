"""Starting Warp, choosing a device, and what stands in the way of one."""

from __future__ import annotations

import logging
import os
from typing import NamedTuple

import warp as wp

from warpsplat.errors import DeviceError, UsageError, shown
from warpsplat.native import messages_hidden
from warpsplat.rendering.cuda import NO_DEVICE, called, cuda_error, runtime, toolkit, words
from warpsplat.rendering.kernel_cache import use_temporary_folder

log = logging.getLogger(__name__)


VISIBLE = "CUDA_VISIBLE_DEVICES"
"""Environment variable that chooses the GPUs which CUDA shows to a process."""


class _Once(logging.Filter):
    """Lets each message pass once, also where several processes send it."""

    def __init__(self) -> None:
        super().__init__()
        self._told: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        text = record.getMessage()
        is_new = text not in self._told
        self._told.add(text)
        return is_new


log.addFilter(_Once())


def start_warp() -> None:
    """Start Warp without its greeting and without a warning where there is no GPU.

    Raises:
        ResourceError: there is no folder for compiled kernels.
    """
    wp.config.log_level = wp.LOG_WARNING
    failure: OSError | None = None
    with messages_hidden() as said:
        try:
            wp.init()
        except OSError as error:
            failure = error
    if failure:
        use_temporary_folder(failure)  # outside the block, as it logs
        with messages_hidden() as said:
            wp.init()
    _errors.extend(line.removeprefix(ERROR) for line in said if line.startswith(ERROR))
    runtime().core.wp_set_error_output_enabled(0)  # Warp raises what it would print


ERROR = "Warp CUDA error: "
_errors: list[str] = []
"""Errors that Warp printed of a driver that it cannot start with; it keeps none."""


class Obstacle(NamedTuple):
    """A reason why a GPU cannot be used."""

    cause: str
    remedy: str = ""
    there: bool = True
    """Whether there is a GPU, as far as can be told."""

    def __str__(self) -> str:
        return f"{self.cause}; {self.remedy}" if self.remedy else self.cause


_failed: dict[str, str] = {}
"""Devices that failed in this process, and how: CUDA refuses all further work on them."""


def note_failure(device: wp.Device, cause: str) -> None:
    """Note that this process cannot use ``device`` any more."""
    _failed[device.alias] = cause


def obstacle(device: wp.Device) -> Obstacle | None:
    """Return why a GPU cannot be used; None if it can, and then its context is open."""
    if device.alias in _failed:
        cause = f"it failed before: {_failed[device.alias]}"
        return Obstacle(cause, "a new process may use it again")
    oldest = min(wp.get_cuda_supported_archs(), default=0)
    if device.arch < oldest:
        cause = f"its architecture is sm_{device.arch}, and {toolkit()} supports sm_{oldest} and newer"
        return Obstacle(cause, f"install a build of Warp for CUDA {runtime().toolkit_version[0] - 1}")
    try:
        with messages_hidden():
            assert device.context
    except RuntimeError as error:
        cause = f"the driver refuses a context: {cuda_error()[1] or error}"
        return Obstacle(cause, "nvidia-smi lists the programs that use it")
    return None


def no_gpu() -> Obstacle:
    """Return why Warp has no GPU at all."""
    warp, visible = runtime(), os.environ.get(VISIBLE)
    if not warp.is_cuda_enabled:
        return Obstacle("this build of Warp has no CUDA", there=False)
    if warp.driver_version is not None and warp.driver_version < warp.min_driver_version:
        needs = f"{toolkit()} needs one for CUDA {words(warp.min_driver_version)}"
        cause = f"the NVIDIA driver is one for CUDA {words(warp.driver_version)}, and {needs}"
        older = f"install a build of Warp for CUDA {warp.driver_version[0]}"
        return Obstacle(cause, f"update the NVIDIA driver, or {older}")
    code, cause = cuda_error()
    if warp.driver_version is None and not code:
        if _errors:
            return Obstacle(_errors[0], "update the NVIDIA driver")
        return Obstacle("there is no NVIDIA driver", there=False)
    if warp.driver_version is None and code != NO_DEVICE:
        return Obstacle(f"the NVIDIA driver does not start: {cause}", "nvidia-smi may say more")
    if visible is not None:
        cause = f"{VISIBLE} is {shown(visible)}, which hides all GPUs"
        return Obstacle(cause, f"unset {VISIBLE}", there=False)
    return Obstacle("the NVIDIA driver finds no GPU", "nvidia-smi should list it", there=False)


def choose_device(name: str = "auto") -> wp.Device:
    """Return a device that can be used, by name: ``auto`` (the first GPU that can be, else the CPU), ``cpu``,
    ``cuda`` or ``cuda:N``. The context of a GPU is open then.

    Raises:
        UsageError: there is no such device.
        DeviceError: it cannot be used.
    """
    if name == "auto":
        return _automatic()
    try:
        with messages_hidden():
            device = wp.get_device(name)
    except Exception as error:
        raise _unknown(name) from error
    if device.is_cuda and (why := obstacle(device)):
        raise DeviceError(f"{called(device)} cannot be used: {why}; --device cpu does without")
    return device


def _unknown(name: str) -> Exception:
    """Return the error about a device that Warp does not have."""
    found = ", ".join(str(d) for d in wp.get_devices())
    text, visible = f"unknown device {shown(name)}; here there are: {found}", os.environ.get(VISIBLE)
    if not name.startswith("cuda") or wp.get_cuda_devices():
        return UsageError(f"{text} ({VISIBLE} is {shown(visible)})" if visible else text)
    why = no_gpu()
    if why.there:
        return DeviceError(f"{name} cannot be used: {why}; --device cpu does without")
    return UsageError(f"{text} ({why})")


def _automatic() -> wp.Device:
    """Return the first GPU that can be used, else the CPU; log why one that is there is not used."""
    reasons = []
    for device in wp.get_cuda_devices():
        why = obstacle(device)
        if why is None:
            break
        reasons.append(f"{called(device)} cannot be used: {why}")
    else:
        device = wp.get_device("cpu")
        if not reasons and (why := no_gpu()).there:
            reasons.append(f"the GPU cannot be used: {why}")
    if reasons:
        log.warning("%s is used; %s", called(device), "; ".join(reasons))
    return device
