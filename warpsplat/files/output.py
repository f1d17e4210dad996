"""Atomic writing of results: to a temporary file in the same folder, which is then renamed.

An existing result keeps its permissions and, where the system allows it, its owner. Symbolic links are
followed. Other hard links to a replaced file keep the old content, as copies made with ``cp -al`` expect.
"""

from __future__ import annotations

import atexit
import contextlib
import gzip
import hashlib
import os
import platform
import re
import stat
import sys
import time
from pathlib import Path

from warpsplat.errors import OutputError, UsageError, cause_of
from warpsplat.files.inputs import STANDARD
from warpsplat.files.marks import HEAD, TAIL, is_marked
from warpsplat.files.remote import check_remote, exists, is_remote, read_remote, write_remote

SVG_ENDINGS = (".svg", ".svgz")
"""Endings of SVG files; the second kind is gzipped."""

FOREIGN = "exists and was not written by warpsplat; --overwrite replaces it"

_unfinished: set[str] = set()
"""Temporary files of this process."""


def check_output(path: Path, *sources: Path, endings: tuple[str, ...] = (), overwrite: bool = True) -> None:
    """Check before the work whether ``path`` can be written; ``-``, the standard output, always can.

    ``sources``: files that it must not replace; ``endings``: of which the name must have one, such as
    ``.svg``, unless there are none; ``overwrite``: whether a file that warpsplat did not write may be
    replaced.

    Raises:
        UsageError: The folder is missing or not writable, or ``path`` is no regular file, one of ``sources``,
            has another ending, or is somebody else's.
    """
    if path == STANDARD:
        return
    try:
        if is_remote(path):
            check_remote(path)
            if not overwrite and exists(path) and not may_replace(path):
                raise UsageError(f"{path}: {FOREIGN}")
            return
        target = check_target(path)
        local = [source for source in sources if not is_remote(source)]
        if any(source.exists() and target == Path(os.path.realpath(source)) for source in local):
            raise UsageError(f"{path}: is the input itself; give another output")
        try:
            check_folder(target.parent)
        except UsageError as error:
            raise UsageError(f"{path}: {error}") from error
        if endings:
            check_ending(path, endings)
        if not overwrite and not may_replace(path):
            raise UsageError(f"{path}: {FOREIGN}")
    except (OSError, ValueError) as error:
        raise UsageError(f"{str(path)[:200]}: cannot be written: {cause_of(error)}") from error


def check_ending(path: Path, endings: tuple[str, ...]) -> None:
    """Raise ``UsageError`` unless a name has one of the ``endings``."""
    if path.suffix.lower() not in endings:
        known = " or ".join(filter(None, (", ".join(endings[:-1]), endings[-1])))
        raise UsageError(f"{path}: a result's name ends with {known}")


def check_folder(folder: Path) -> None:
    """Remove files that dead runs left in ``folder``; raise ``UsageError`` if it cannot be written to."""
    remove_stale(folder)
    try:
        handle, name = _temporary(folder)
    except OSError as error:
        raise UsageError(f"cannot write to {folder}: {error.strerror}") from error
    os.close(handle)
    _discard(name)


def make_folder(folder: Path) -> None:
    """Create the folder of a result, if it is missing; raise ``OutputError`` if that fails."""
    if is_remote(folder):
        return  # remote folders are created with their files
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror}") from error


def check_target(path: Path) -> Path:
    """Return the file that a result is written to, behind all links: a regular one, or none yet.

    Raises:
        UsageError: A folder, a pipe, a device, a loop of links, or a file in a missing folder.
        OSError: The name is too long, or a folder on the way may not be read.
    """
    if path.is_dir():
        raise UsageError(f"{path}: is a folder, not a file")
    target = _target(path)
    folder = target.parent
    if not folder.is_dir():
        if folder.exists():
            raise UsageError(f"{path}: {folder} is not a folder")
        linked = f", to which {path.name} links," if path.is_symlink() else ""
        raise UsageError(f"{path}: the folder {folder}{linked} does not exist")
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISREG(os.lstat(target).st_mode):
            raise UsageError(f"{path}: is a device or a pipe, not a file")
    return target


def _target(path: Path) -> Path:
    """Return the file behind all links; raises ``UsageError`` for a loop."""
    real = Path(os.path.realpath(path))
    if real.is_symlink():
        raise UsageError(f"{path}: is a loop of links")
    return real


def may_replace(path: Path) -> bool:
    """Return whether ``path`` is free, empty, or a file that warpsplat wrote.

    Raises:
        OSError: It cannot be read.
        ImageError: The same, behind a URL.
    """
    if is_remote(path):
        return is_marked(read_remote(path, HEAD), b"")
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
            file.seek(max(0, file.seek(0, os.SEEK_END) - TAIL))
            return is_marked(head, file.read())
    except FileNotFoundError:
        return True


def svg_bytes(path: Path, text: str) -> bytes:
    """Return the content of an SVG's file, gzipped if the name of ``path`` asks for it."""
    data = text.encode()
    return gzip.compress(data, mtime=0) if path.suffix.lower() == SVG_ENDINGS[1] else data


def write_result(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path`` atomically, or to the standard output for ``-``.

    Raises:
        OutputError: It could not be written.
    """
    if is_remote(path):
        write_remote(path, data)
        return
    if path != STANDARD:
        write_atomically(path, data)
        return
    try:
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
    except (OSError, ValueError) as error:
        raise OutputError(f"standard output: could not be written: {cause_of(error)}") from error


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data`` to a new file in the folder of ``path``, then rename it.

    Raises:
        OutputError: The disk is full, or the folder cannot be written to; ``path`` is as it was.
    """
    try:
        target = _target(path)
        handle, name = _temporary(target.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                _keep_attributes(target, handle)
                file.write(data)
                file.flush()
                os.fsync(handle)
            os.replace(name, target)
        finally:
            _discard(name)
    except UsageError as error:
        raise OutputError(str(error)) from error
    except OSError as error:
        raise OutputError(f"{path}: could not be written: {cause_of(error)}") from error


def _keep_attributes(target: Path, handle: int) -> None:
    """Give a new file the owner and permissions of the one that it replaces, if any."""
    with contextlib.suppress(FileNotFoundError, AttributeError):  # the latter on Windows
        old = os.stat(target)
        for owner, group in ((-1, old.st_gid), (old.st_uid, -1)):
            with contextlib.suppress(OSError):
                os.fchown(handle, owner, group)
        with contextlib.suppress(OSError):
            os.fchmod(handle, stat.S_IMODE(old.st_mode))  # last: a new owner clears bits


def _machine() -> str:
    """Return an identifier of the host and its process namespace, in which process ids are unique."""
    space = ""
    with contextlib.suppress(OSError):
        space = os.readlink("/proc/self/ns/pid")
    return hashlib.sha256(f"{platform.node()} {space}".encode()).hexdigest()[:8]


TEMPORARY = re.compile(r"\.warpsplat-([0-9a-f]{8})-(\d{1,10})-[0-9a-f]{8}\.tmp")


def _temporary(folder: Path) -> tuple[int, str]:
    """Create a file in ``folder``, open for writing, with the default permissions of new files."""
    name = os.path.join(folder, f".warpsplat-{_machine()}-{os.getpid()}-{os.urandom(4).hex()}.tmp")
    _unfinished.add(name)
    try:
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
        return os.open(name, flags, 0o666), name
    except BaseException:
        _discard(name)
        raise


def _discard(name: str) -> None:
    """Remove a temporary file, unless it was renamed."""
    with contextlib.suppress(OSError):
        os.unlink(name)
    _unfinished.discard(name)


@atexit.register
def remove_unfinished() -> None:
    """Remove the temporary files of this process at its end."""
    for name in list(_unfinished):
        _discard(name)


def remove_stale(folder: Path) -> None:
    """Remove the temporary files that dead runs left in ``folder``."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            found = TEMPORARY.fullmatch(entry.name)
            if not found or not entry.is_file(follow_symlinks=False):
                continue
            dead = found[1] == _machine() and _is_dead(int(found[2]))
            age = time.time() - entry.stat(follow_symlinks=False).st_mtime
            if dead or age > 86_400:  # seconds, which is what a write takes
                with contextlib.suppress(OSError):
                    os.unlink(entry.path)


def _is_dead(process: int) -> bool:
    """Return whether a process of this machine has certainly ended."""
    if os.name == "posix" and process > 0:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        except (OSError, OverflowError):
            pass
    return False
