"""The system below Python: messages of native code, memory, cores."""

from __future__ import annotations

import contextlib
import ctypes
import os
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import IO

STRIP_PIXELS = 1 << 20
"""Pixels of a large image that are converted, drawn or compared at a time, for little memory."""

_lock = threading.Lock()
_hiding = 0
"""Threads that hide messages."""
_saved = -1
"""A copy of the process's standard error, meanwhile."""
_hidden: IO[bytes] | None = None
"""The file that it goes to, meanwhile."""


@contextlib.contextmanager
def messages_hidden() -> Iterator[list[str]]:
    """Hide what goes to the process's standard error: native code writes there behind Python's back.

    It comes back when the last of all threads that ask for this is done. Yields a list to which the lines
    that were hidden are added at the end of the block.
    """
    global _hiding, _saved, _hidden  # noqa: PLW0603 - a process has one standard error
    said: list[str] = []
    with _lock:
        if not _hiding:
            with contextlib.suppress(OSError):  # else it is shown
                _saved = os.dup(2)
                _hidden = _put_aside(2)
        _hiding += 1
        begin = _hidden.seek(0, os.SEEK_END) if _hidden else 0
    try:
        yield said
    finally:
        with _lock:
            if _hidden:
                _hidden.seek(begin)
                said += _hidden.read().decode(errors="replace").splitlines()
            _hiding -= 1
            if not _hiding and _saved >= 0:
                os.dup2(_saved, 2)
                os.close(_saved)
                _saved = -1
            if not _hiding and _hidden:
                _hidden.close()
                _hidden = None


def _put_aside(descriptor: int) -> IO[bytes] | None:
    """Have all that is written to a file descriptor go to a file, or be discarded where there can be none."""
    try:
        file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - stays open
    except OSError:
        discard_output(descriptor)
        return None
    os.dup2(file.fileno(), descriptor)
    return file


def discard_output(descriptor: int) -> None:
    """Have all that is written to a file descriptor discarded."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)


def write_message(text: str) -> None:
    """Write to the standard error as it is, or was before it was hidden; raise ``OSError`` if that fails."""
    with _lock:
        os.write(_saved if _hiding and _saved >= 0 else 2, text.encode(errors="backslashreplace"))


def release_memory() -> None:
    """Hand what was freed back to the system, where its C library keeps it (glibc).

    It keeps freed arrays of up to 32 MiB for the next ones, in pieces that these do not fit into: in a run
    whose arrays change in size with its shapes that is half a gigabyte after a thousand steps.
    """
    with contextlib.suppress(AttributeError, OSError, TypeError):  # another C library, or Windows
        ctypes.CDLL(None).malloc_trim(0)


def free_memory() -> int | None:
    """Memory that can be had without swapping [bytes]; None where the system does not say (not Linux)."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) << 10
    return None


def machine_memory() -> int | None:
    """Memory of this machine, or of the container that the program runs in [bytes]; None: unknown."""
    sizes = []
    with contextlib.suppress(AttributeError, ValueError, OSError):  # Windows
        sizes.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    sizes += container_limits()
    return min(sizes, default=None)


def container_limits(root: Path = Path("/")) -> list[int]:
    """Return the memory limits that control groups of either version set for this process [bytes] (Linux).

    ``root``: of the file system.
    """
    limits = []
    with contextlib.suppress(OSError, ValueError):
        for line in (root / "proc/self/cgroup").read_text().splitlines():
            number, controllers, path = line.split(":", 2)
            if number == "0":
                base, name = root / "sys/fs/cgroup", "memory.max"
            elif "memory" in controllers.split(","):
                base, name = root / "sys/fs/cgroup/memory", "memory.limit_in_bytes"
            else:
                continue
            folder = base / path.lstrip("/")
            for each in (folder, *folder.parents):  # a limit of a group holds for those below
                with contextlib.suppress(OSError, ValueError):  # "max", or a group that is not seen from here
                    limits.append(int((each / name).read_text()))
                if each == base:
                    break
    return limits


def available_cores() -> int:
    """CPU cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # macOS, Windows
        return os.cpu_count() or 1
