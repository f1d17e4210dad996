"""Loading compiled kernels from Warp's cache, even if that is damaged or cannot be written.

Warp trusts its cache: a file that was cut short, as when a machine crashes, makes every later run fail. Here
what cannot be loaded is compiled again, once.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import shutil
import tempfile
import threading
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warp as wp

from warpsplat.errors import DeviceError, ResourceError, cause_of, explain
from warpsplat.native import messages_hidden
from warpsplat.rendering.compiler import compile_by
from warpsplat.rendering.cuda import OUT_OF_MEMORY, called, cuda_error

log = logging.getLogger(__name__)

BINARIES = (".o", ".cubin", ".ptx")
"""Suffixes of compiled modules."""

_temporary: list[str] = []
"""The folder that replaces an unusable cache while this process lives."""


def load(kernel: wp.Kernel, device: wp.Device) -> None:
    """Load a kernel's module, compiled if necessary. What cannot be loaded from the cache is compiled again.

    Raises:
        DeviceError: it cannot be compiled for the device, or loaded.
        ResourceError: neither the cache nor a temporary folder can hold compiled kernels.
    """
    module = kernel.module
    block_dim = 1 if device.is_cpu else module.options["block_dim"]
    if (None if device.is_cpu else device.context, block_dim) in module.execs:
        return
    with _loading:
        _load(module, device, block_dim)


_loading = threading.RLock()
"""One thread at a time compiles or loads."""


def _load(module: wp.Module, device: wp.Device, block_dim: Any) -> None:
    """Load a module unless it is loaded; again if files may be damaged, or another folder may hold them."""
    while (None if device.is_cpu else device.context, block_dim) not in module.execs:
        files = _Files.of(module, device, block_dim)
        cached = files.exist()
        try:
            if not cached:
                with alone_with(files.folder):
                    if not files.exist():
                        compile_by(lambda: wp.load_module(module, device, block_dim=block_dim))
            with messages_hidden():
                wp.load_module(module, device, block_dim=block_dim)
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


@dataclass(frozen=True)
class _Files:
    """The files of a module that a device loads."""

    folder: Path
    binary: Path
    meta: Path

    @staticmethod
    def of(module: wp.Module, device: wp.Device, block_dim: Any) -> _Files:
        """Return the files by Warp's names, which tell apart architectures of GPUs, and processors."""
        folder = _place() / module.get_module_identifier(block_dim)
        binary = module._get_compile_output_name(device, block_dim=block_dim)
        return _Files(folder, folder / binary, folder / module._get_meta_name(block_dim=block_dim))

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
    handle = None
    try:
        with contextlib.suppress(OSError, ImportError):
            import fcntl  # POSIX only

            handle = os.open(folder.with_name(LOCK), os.O_RDWR | os.O_CREAT, 0o666)
            fcntl.lockf(handle, fcntl.LOCK_EX, 1, zlib.crc32(folder.name.encode()))
        yield
    finally:
        if handle is not None:
            os.close(handle)


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
