"""Writing results: beside, then renamed, so that nothing half-written is ever found."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from warpsplat.errors import OutputError, UsageError


def check_output(path: Path, *sources: Path) -> None:
    """Find out before the work whether ``path`` can be written.

    Raises:
        UsageError: the folder is missing or not writable, ``path`` is no regular file, or one of ``sources``.
    """
    try:
        _check_output(path, sources)
    except (OSError, ValueError) as error:
        cause = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UsageError(f"{str(path)[:200]}: cannot be written: {cause}") from error


def _check_output(path: Path, sources: tuple[Path, ...]) -> None:
    folder = path.parent
    if not folder.exists():
        raise UsageError(f"{path}: the folder {folder} does not exist")
    if not folder.is_dir():
        raise UsageError(f"{path}: {folder} is not a folder")
    if path.is_dir():
        raise UsageError(f"{path}: is a folder, not a file")
    if path.exists() and not path.is_file():
        raise UsageError(f"{path}: is a device or a pipe, not a file")
    for source in sources:
        if source.exists() and path.resolve() == source.resolve():
            raise UsageError(f"{path}: is the input itself; give another output")
    try:
        handle, name = tempfile.mkstemp(prefix=".warpsplat-", dir=folder)
    except OSError as error:
        raise UsageError(f"{path}: cannot write to {folder}: {error.strerror}") from error
    os.close(handle)
    os.unlink(name)


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data`` to a new file beside ``path``, then rename it. Of a link, the target is replaced.

    Raises:
        OutputError: the disk is full, or the folder cannot be written; ``path`` is as it was.
    """
    name: str | None = None
    path = path.resolve()
    try:
        handle, name = tempfile.mkstemp(prefix=".warpsplat-", suffix=path.suffix, dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    except BaseException as error:
        if name:
            with contextlib.suppress(OSError):
                os.unlink(name)
        if isinstance(error, OSError):
            raise OutputError(f"{path}: could not be written: {error.strerror or error}") from error
        raise
