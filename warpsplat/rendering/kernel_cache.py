"""Loading compiled kernels from Warp's cache, even if that is damaged or cannot be written.

Modules that are not in the cache are compiled side by side: what will be launched is announced (``expect``),
and compiled when the first of it is needed, or before (``compile_expected``).

Warp trusts its cache: a file that was cut short, as when a machine crashes, makes every later run fail. Here
what cannot be loaded is compiled again, once.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import logging
import os
import shutil
import tempfile
import threading
import time
import zlib
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path

import warp as wp

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

from warpsplat.errors import DeviceError, ResourceError, cause_of, explain
from warpsplat.native import messages_hidden
from warpsplat.rendering.compiler import compile_later, wait_for
from warpsplat.rendering.cuda import OUT_OF_MEMORY, called, cuda_error

log = logging.getLogger(__name__)

BINARIES = (".o", ".cubin", ".ptx")
"""Suffixes of compiled modules."""

_temporary: list[str] = []
"""The folder that replaces an unusable cache while this process lives."""


_expected: list[_Build] = []
"""Builds that were announced and have not begun."""

_builds: dict[Path, Future[None]] = {}
"""Builds under way, by the files that they make."""

_loading = threading.RLock()
"""One thread at a time loads, or asks for modules to be compiled."""


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_builds.clear)  # the threads that compile are the parent's


def expect(kernel: wp.Kernel, device: wp.Device) -> None:
    """Announce that a kernel will be needed."""
    build = _Build.of(kernel, device)
    if not build.is_loaded():
        with _loading:
            _expected.append(build)


def compile_expected() -> None:
    """Have the modules compiled that were announced and are not in the cache, without waiting for them."""
    with _loading:
        # All files are named first, which has to wait while Warp writes the source of a module.
        named = {build.files(): build for build in _expected if not build.is_loaded()}
        _expected.clear()
        for files, build in named.items():
            if not files.exist():
                build.begin(files)


def load(kernel: wp.Kernel, device: wp.Device) -> None:
    """Load a kernel's module, compiled if necessary, with all others that were announced.

    What cannot be loaded from the cache is compiled again.

    Raises:
        DeviceError: it cannot be compiled for the device, or loaded.
        ResourceError: neither the cache nor a temporary folder can hold compiled kernels.
    """
    build = _Build.of(kernel, device)
    if build.is_loaded():
        return
    with _loading:
        _load(build)


def _load(build: _Build) -> None:
    """Load a module unless it is loaded; again if files may be damaged, or another folder may hold them."""
    module, device = build.module, build.device
    while not build.is_loaded():
        files = build.files()
        cached = files.exist()
        try:
            if not cached:
                wait_for(functools.partial(_begin, build, files))
                module.mark_modified()  # or Warp would remember that it failed before it was waited for
            with messages_hidden():
                wp.load_module(module, device, block_dim=build.block_dim)
        except Exception as error:  # Warp and its compiler raise exceptions of many types
            module.mark_modified()  # or Warp would remember the failure
            if explain(error)[0].startswith("not enough memory"):
                raise
            lacking = device.is_cuda and cuda_error()[0] == OUT_OF_MEMORY
            suspect = cached and not lacking
            if suspect and _discard(files.folder):
                continue
            if _temporary or not (suspect or isinstance(error, OSError)):
                raise _failure(error, device, compiled=files.exist()) from error
            use_temporary_folder(error)


def _begin(build: _Build, files: _Files) -> Future[None]:
    """Have a module compiled with those that were announced."""
    begun = build.begin(files)
    compile_expected()
    return begun


@dataclass(frozen=True)
class _Build:
    """A module to compile for a device."""

    module: wp.Module
    device: wp.Device
    block_dim: int | None

    @staticmethod
    def of(kernel: wp.Kernel, device: wp.Device) -> _Build:
        """Return the build with a kernel."""
        module = kernel.module
        return _Build(module, device, 1 if device.is_cpu else module.options["block_dim"])

    def is_loaded(self) -> bool:
        """Return whether the module is loaded."""
        return (None if self.device.is_cpu else self.device.context, self.block_dim) in self.module.execs

    def files(self) -> _Files:
        """Return the files by Warp's names, which tell apart architectures of GPUs, and processors."""
        folder = _place() / self.module.get_module_identifier(self.block_dim)
        binary = self.module._get_compile_output_name(self.device, block_dim=self.block_dim)
        return _Files(folder, folder / binary, folder / self.module._get_meta_name(block_dim=self.block_dim))

    def begin(self, files: _Files) -> Future[None]:
        """Have the module compiled, unless it is being compiled."""
        begun = _builds.get(files.binary)
        if begun:
            return begun
        options = self.module.resolved_options[self.block_dim]

        def work() -> None:
            with alone_with(files.folder):
                if not files.exist():
                    self.module._compile(self.device, files.folder, options=options)

        _builds[files.binary] = made = compile_later(work)
        made.add_done_callback(lambda _: _builds.pop(files.binary))
        return made


@dataclass(frozen=True)
class _Files:
    """The files of a module that a device loads."""

    folder: Path
    binary: Path
    meta: Path

    def exist(self) -> bool:
        """Return whether there is nothing to compile."""
        return self.binary.exists() and self.meta.exists()


def _failure(error: Exception, device: wp.Device, *, compiled: bool) -> Exception:
    """Return what to raise where a module cannot be compiled or loaded."""
    if isinstance(error, OSError):
        folder = wp.config.kernel_cache_dir
        return ResourceError(f"kernel cache {folder}: {_cause(error)}; set WARP_CACHE_PATH to another folder")
    reinstall = "pip install --force-reinstall warp-lang may help"
    hint = "--device cpu does without" if device.is_cuda else reinstall
    cause = (compiled and device.is_cuda and cuda_error()[1]) or cause_of(error)
    done = "loaded on" if compiled else "compiled for"
    return DeviceError(f"kernels cannot be {done} {called(device)}: {cause}; {hint}")


LOCK = "warpsplat.lock"
"""An empty file in the cache; a byte of it is locked for each module that is being compiled."""


@contextlib.contextmanager
def alone_with(folder: Path) -> Iterator[None]:
    """Hold the lock on the module of ``folder``, so that other processes wait for it instead of compiling it.

    Other modules may be compiled meanwhile. Where locking is not possible, several processes may compile the
    same module, which Warp allows: it renames finished folders into place.
    """
    handle, place = _lock_file(folder.with_name(LOCK)), zlib.crc32(folder.name.encode())
    is_locked = handle is not None and _lock(handle, place)
    try:
        yield
    finally:
        if handle is not None and is_locked:
            fcntl.lockf(handle, fcntl.LOCK_UN, 1, place)


@functools.cache
def _lock_file(path: Path) -> int | None:
    """Return a descriptor that stays open: to close one ends all locks of the process on the file."""
    with contextlib.suppress(OSError):
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o666) if fcntl else None
    return None


def _lock(handle: int, place: int) -> bool:
    """Wait for the lock on a byte; return False where locking is not possible.

    Two processes whose threads wait for each other's locks would be refused as deadlocked if they waited
    within the system.
    """
    lock_interval = 0.02  # seconds after which a lock that another process holds is tried again
    while True:
        try:
            fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
        except (BlockingIOError, PermissionError):
            time.sleep(lock_interval)
        except OSError:
            return False
        else:
            return True


def _place() -> Path:
    assert wp.config.kernel_cache_dir, "Warp chooses one when it starts"
    return Path(wp.config.kernel_cache_dir)


def _cause(failure: BaseException | None) -> str:
    return getattr(failure, "strerror", None) or str(failure).splitlines()[0]


def use_temporary_folder(failure: BaseException | None) -> None:
    """Keep compiled kernels in a temporary folder, which is removed when the process ends.

    Raises:
        ResourceError: a temporary folder cannot be made either.
    """
    if _temporary:
        return
    cause = _cause(failure)
    place = wp.config.kernel_cache_dir or os.environ.get("WARP_CACHE_PATH") or "in the home folder"
    try:
        made = tempfile.mkdtemp(prefix="warpsplat-kernels-")
    except OSError as error:
        raise ResourceError(
            f"kernel cache {place}: {cause}; set WARP_CACHE_PATH to a folder that can be written"
        ) from error
    log.warning(
        "kernel cache %s: %s; kernels are compiled for this run only (WARP_CACHE_PATH names another folder)",
        place,
        cause,
    )
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    _temporary.append(made)
    wp.config.kernel_cache_dir = made


def _discard(folder: Path) -> bool:
    """Remove a module's folder in one step, as other processes may be using it; return whether it is gone."""
    away = folder.with_name(f"{folder.name}.damaged-{os.getpid()}")
    try:
        folder.rename(away)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    shutil.rmtree(away, ignore_errors=True)
    return True
