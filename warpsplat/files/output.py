"""Writing results: beside, then renamed, so that nothing half-written is ever found.

An existing result keeps its permissions and, where the system allows it, its owner. Of a symbolic link the
target is replaced. Of a file with several hard links only the name that was given is: the others keep the old
content, as copies made with ``cp -al`` expect.
"""

from __future__ import annotations

import atexit
import contextlib
import gzip
import hashlib
import os
import platform
import re
import secrets
import stat
import sys
import time
import zlib
from pathlib import Path

from warpsplat.errors import OutputError, UsageError, WarpsplatError
from warpsplat.files.inputs import STANDARD
from warpsplat.files.marks import PDF_START, PDF_TAIL, PNG_MARK, is_marked_pdf
from warpsplat.files.remote import is_remote, read_remote, write_remote

SVG_MARKS = b"<!--warpsplat", b"<metadata>warpsplat "
"""In the head of every SVG written here (``svg.write_svg``), now and by earlier versions."""

SHORT_SVG = re.compile(
    rb'<svg viewBox="0 0 [\d.]+ [\d.]+" xmlns="http://www\.w3\.org/2000/svg" height="\d+" width="\d+">'
)
"""How short ones begin: nobody else has the attributes in this order (``svg.write.shortened``)."""

GIF_COMMENT = b"warpsplat"
"""Comment in the head of every GIF written here."""

WEBP_MARK = b"wspl\x0a\0\0\0warpsplat\n"
"""Chunk at the end of every WebP written here, of a kind that readers pass over."""

MP4_MARK = b"\0\0\0\x12freewarpsplat\n"
"""Box at the end of every MP4 written here, of the kind that is there to be passed over."""

MARKED_ENDS = {b"RIFF": WEBP_MARK, b"ftyp": MP4_MARK}
"""Marks at the end of files, by what stands at the beginning of their kind, or four bytes behind it."""

PAGE_MARK = b"<!--warpsplat page-->"
"""In the head of every page written here (``pages.MARK``)."""

HEAD = 2000
"""Bytes at the start of a file in which its mark stands."""

OLD = 86_400
"""Age [s] from which a temporary file is a dead run's, whatever its name says: a write takes seconds."""

_unfinished: set[str] = set()
"""Temporary files of this process."""


SVG_ENDINGS = (".svg", ".svgz")
"""Of names of SVG files; the second kind is gzipped."""


def check_output(path: Path, *sources: Path, endings: tuple[str, ...] = (), overwrite: bool = True) -> None:
    """Find out before the work whether ``path`` can be written, or ``-``, the standard output.

    Args:
        path: the result.
        sources: files that it must not replace.
        endings: one of which the name must have, as ``.svg``; any if there are none.
        overwrite: whether a file that warpsplat did not write may be replaced.

    Raises:
        UsageError: the folder is missing or not writable, ``path`` is no regular file, one of ``sources``, of
            another ending, or somebody else's.
    """
    if path == STANDARD:
        return
    try:
        _check_output(path, sources)
        if endings and path.suffix.lower() not in endings:
            known = " or ".join(filter(None, (", ".join(endings[:-1]), endings[-1])))
            raise UsageError(f"{path}: is no kind of result; a result's name ends with {known}")
        if not overwrite and not may_replace(path):
            raise UsageError(f"{path}: exists and was not written by warpsplat; --overwrite replaces it")
    except (OSError, ValueError) as error:
        cause = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UsageError(f"{str(path)[:200]}: cannot be written: {cause}") from error


def _check_output(path: Path, sources: tuple[Path, ...]) -> None:
    target = check_target(path)
    for source in sources:
        if source.exists() and target == Path(os.path.realpath(source)):
            raise UsageError(f"{path}: is the input itself; give another output")
    try:
        check_folder(target.parent)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def check_folder(folder: Path) -> None:
    """Find out whether files can be made in ``folder``, and remove what dead runs left there.

    Raises:
        UsageError: they cannot.
    """
    remove_stale(folder)
    try:
        handle, name = _temporary(folder)
    except OSError as error:
        raise UsageError(f"cannot write to {folder}: {error.strerror}") from error
    os.close(handle)
    _discard(name)


def make_folder(folder: Path) -> None:
    """Make the folder of a result, if it is not there.

    Raises:
        OutputError: it cannot be made.
    """
    if is_remote(folder):
        return  # comes with its files
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror}") from error


def check_target(path: Path) -> Path:
    """The file that a result is written to, behind all links: a regular one, or one that is not there yet.

    Raises:
        UsageError: a folder, a pipe, a device, a loop of links, or a file in a folder that is missing.
        OSError: the name is too long, or what leads there may not be read.
    """
    if path.is_dir():
        raise UsageError(f"{path}: is a folder, not a file")
    target = _target(path)
    folder = target.parent
    if not folder.is_dir():
        raise UsageError(f"{path}: {folder} is not a folder" if folder.exists() else _missing(path, folder))
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISREG(os.lstat(target).st_mode):
            raise UsageError(f"{path}: is a device or a pipe, not a file")
    return target


def _missing(path: Path, folder: Path) -> str:
    linked = f", to which {path.name} links," if path.is_symlink() else ""
    return f"{path}: the folder {folder}{linked} does not exist"


def _target(path: Path) -> Path:
    """The file itself, behind all links.

    Raises:
        UsageError: the links lead round in a circle.
    """
    real = Path(os.path.realpath(path))
    if real.is_symlink():
        raise UsageError(f"{path}: is a loop of links")
    return real


def may_replace(path: Path) -> bool:
    """Whether ``path`` is free, empty, or a file that warpsplat wrote.

    Raises:
        OSError: it cannot be read.
        ImageError: the same, behind a URL.
    """
    try:
        if is_remote(path):
            head = read_remote(path, HEAD)
        else:
            with path.open("rb") as file:
                head = file.read(HEAD)
                if head.startswith(PDF_START):
                    size = file.seek(0, os.SEEK_END)
                    file.seek(max(0, size - PDF_TAIL))
                    return is_marked_pdf(file.read())
                for begin, mark in MARKED_ENDS.items():
                    if head.startswith(begin) or head.startswith(begin, 4):
                        size = file.seek(0, os.SEEK_END)
                        file.seek(max(0, size - len(mark)))
                        return file.read() == mark
    except FileNotFoundError:
        return True
    head = unpacked(head)
    gif = b"!\xfe" + bytes([len(GIF_COMMENT)]) + GIF_COMMENT
    marks = (*SVG_MARKS, PAGE_MARK, PNG_MARK, gif)
    return not head or SHORT_SVG.match(head) is not None or any(mark in head for mark in marks)


def unpacked(head: bytes) -> bytes:
    """What the beginning of a file says, gzipped or not."""
    if head[:2] != GZIP:
        return head
    try:
        return zlib.decompressobj(wbits=zlib.MAX_WBITS | 16).decompress(head)
    except zlib.error:
        return head


GZIP = b"\x1f\x8b"
"""How gzipped files begin."""


def svg_bytes(path: Path, text: str) -> bytes:
    """What an SVG's file holds, gzipped where the name of ``path`` says so."""
    data = text.encode()
    return gzip.compress(data, mtime=0) if path.suffix.lower() == SVG_ENDINGS[1] else data


def write_result(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path`` atomically, or to the standard output for ``-``.

    Raises:
        OutputError: it could not be written.
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
        cause = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise OutputError(f"standard output: could not be written: {cause}") from error


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data`` to a new file beside ``path``, then rename it.

    Raises:
        OutputError: the disk is full, or the folder cannot be written; ``path`` is as it was.
    """
    name: str | None = None
    try:
        target = _target(path)
        handle, name = _temporary(target.parent)
        with os.fdopen(handle, "wb") as file:
            _keep_attributes(target, handle)
            file.write(data)
            file.flush()
            os.fsync(handle)
        os.replace(name, target)
        _unfinished.discard(name)
    except BaseException as error:
        if name:
            _discard(name)
        if isinstance(error, OSError):
            raise OutputError(f"{path}: could not be written: {error.strerror or error}") from error
        if isinstance(error, WarpsplatError):
            raise OutputError(str(error)) from error
        raise


def _keep_attributes(target: Path, handle: int) -> None:
    """Give a new file the owner and permissions of the one that it replaces; a free name has none."""
    try:
        old = os.stat(target)
    except FileNotFoundError:
        return
    if not hasattr(os, "fchown"):  # Windows
        return
    for owner, group in ((-1, old.st_gid), (old.st_uid, -1)):
        with contextlib.suppress(OSError):
            os.fchown(handle, owner, group)
    with contextlib.suppress(OSError):
        os.fchmod(handle, stat.S_IMODE(old.st_mode))  # last: a new owner clears bits


def _machine() -> str:
    """Names where a process number means something: the host, and its name space of processes."""
    space = ""
    with contextlib.suppress(OSError):
        space = os.readlink("/proc/self/ns/pid")
    return hashlib.sha256(f"{platform.node()} {space}".encode()).hexdigest()[:8]


TEMPORARY = re.compile(r"\.warpsplat-([0-9a-f]{8})-(\d{1,10})-[0-9a-f]{8}\.tmp")


def _temporary(folder: Path) -> tuple[int, str]:
    """A new file in ``folder``, open for writing, with the permissions that the process gives new files."""
    name = os.path.join(folder, f".warpsplat-{_machine()}-{os.getpid()}-{secrets.token_hex(4)}.tmp")
    _unfinished.add(name)
    try:
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
        return os.open(name, flags, 0o666), name
    except BaseException:
        _discard(name)
        raise


def _discard(name: str) -> None:
    with contextlib.suppress(OSError):
        os.unlink(name)
    _unfinished.discard(name)


@atexit.register
def remove_unfinished() -> None:
    """Remove the temporary files of this process, which ends."""
    for name in list(_unfinished):
        _discard(name)


def remove_stale(folder: Path) -> None:
    """Remove the temporary files that dead runs left in ``folder``, never those of a run that lives."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            found = TEMPORARY.fullmatch(entry.name)
            if not found or not entry.is_file(follow_symlinks=False):
                continue
            dead = found[1] == _machine() and not _alive(int(found[2]))
            if dead or time.time() - entry.stat(follow_symlinks=False).st_mtime > OLD:
                with contextlib.suppress(OSError):
                    os.unlink(entry.path)


def _alive(process: int) -> bool:
    """Whether a process of this machine lives; where that cannot be asked, it may."""
    if os.name != "posix" or process <= 0:
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
