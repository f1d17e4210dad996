"""Starting Warp and choosing a device."""

from __future__ import annotations

import warp as wp

from warpsplat.errors import UsageError, shown
from warpsplat.native import messages_hidden
from warpsplat.rendering.kernel_cache import use_temporary_folder


def start_warp() -> None:
    """Start Warp without its greeting and without a warning where there is no GPU.

    Raises:
        ResourceError: there is no folder for compiled kernels.
    """
    wp.config.log_level = wp.LOG_WARNING
    with messages_hidden():
        try:
            wp.init()
            return
        except OSError as error:
            failure = error
    use_temporary_folder(failure)  # outside the block, as it logs
    with messages_hidden():
        wp.init()


def choose_device(name: str = "auto") -> wp.Device:
    """Return a device by name: ``auto`` (the first GPU, else the CPU), ``cpu``, ``cuda`` or ``cuda:N``.

    Raises:
        UsageError: there is no such device.
    """
    if name == "auto":
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    try:
        with messages_hidden():
            return wp.get_device(name)
    except Exception as error:
        found = ", ".join(str(d) for d in wp.get_devices())
        raise UsageError(f"unknown device {shown(name)}; here there are: {found}") from error
