"""Writing results: beside, then renamed, so that nothing half-written is ever found."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from warpsplat.errors import OutputError, UsageError


def check_output(path: Path) -> None:
    """Find out before the work whether ``path`` can be written.

    Raises:
        UsageError: the folder is missing or not writable, or ``path`` is a folder.
    """
    folder = path.parent
    if not folder.exists():
        raise UsageError(f"{path}: the folder {folder} does not exist")
    if not folder.is_dir():
        raise UsageError(f"{path}: {folder} is not a folder")
    if path.is_dir():
        raise UsageError(f"{path}: is a folder, not a file")
    try:
        handle, name = tempfile.mkstemp(prefix=".warpsplat-", dir=folder)
    except OSError as error:
        raise UsageError(f"{path}: cannot write to {folder}: {error.strerror}") from error
    os.close(handle)
    os.unlink(name)


def write_atomically(path: Path, data: bytes) -> None:
    """Write ``data`` to a new file beside ``path``, then rename it.

    Raises:
        OutputError: the disk is full, or the folder cannot be written; ``path`` is as it was.
    """
    name: str | None = None
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
