"""Reading of a file, or of the standard input for ``-``."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

from warpsplat.errors import ImageError, cause_of
from warpsplat.files.remote import is_remote, read_remote

STANDARD = Path("-")
"""The standard input, or the standard output."""

MAX_INPUT = 1 << 30
"""Largest input [bytes]: an endless pipe or device must not fill the memory."""


def input_name(path: Path) -> str:
    """Return what messages call an input."""
    return "standard input" if path == STANDARD else str(path)


def read_input(path: Path, what: str = "an image", *, limit: int = MAX_INPUT) -> bytes:
    """Return all bytes of a file, or of the standard input for ``-``; ``what`` messages say it should be.

    Raises:
        ImageError: Missing, a folder, not permitted, a device, empty, or more than ``limit`` bytes.
    """
    name = input_name(path)
    try:
        if is_remote(path):
            data = read_remote(path, limit)
        elif path == STANDARD:
            data = sys.stdin.buffer.read(limit + 1)
        else:
            with path.open("rb") as file:
                mode = os.fstat(file.fileno()).st_mode
                if stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
                    raise ImageError(f"{name}: is a device, not {what}")
                data = file.read(limit + 1)
    except FileNotFoundError:
        raise ImageError(f"{name}: no such file") from None
    except IsADirectoryError:
        hint = "; warpsplat batch takes folders" if what == "an image" else ""
        raise ImageError(f"{name}: is a folder, not {what}{hint}") from None
    except PermissionError:
        raise ImageError(f"{name}: no permission to read it") from None
    except (OSError, ValueError) as error:  # a loop of links, a name with a NUL, a name too long
        raise ImageError(f"{name}: cannot be read: {cause_of(error)}") from error
    check_data(data, name, limit)
    return data


def check_data(data: bytes, name: str, limit: int) -> None:
    """Raise ``ImageError`` for no data, or more than ``limit`` bytes; ``name``: for messages."""
    if len(data) > limit:
        raise ImageError(f"{name}: is larger than {limit >> 20} MiB")
    if not data:
        raise ImageError(f"{name}: is empty")
