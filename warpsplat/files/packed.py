"""Numbers and arrays in one file, which NumPy's ``load`` and any unzip program can read.

An uncompressed zip archive: first ``header.json``, then an ``.npy`` file for each array. Reading it runs and
unpickles nothing, and takes no more memory than a few times the file's length.
"""

from __future__ import annotations

import io
import json
import math
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.errors import CheckpointError, cause_of, cut
from warpsplat.files.inputs import read_input

HEADER = "header.json"

MARK = b'{"warpsplat": "checkpoint"'
"""The beginning of the header."""

FORMAT = 1
"""Version of the format; files of others are refused."""

LONGEST = 16 << 20
"""Longest header, and longest central directory of the archive [bytes]."""

ARRAY = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '(?P<type><[fi]4)', 'fortran_order': False, "
    rb"'shape': \((?P<shape>[\d, ]{0,40})\), \} *\n",
    re.DOTALL,
)
"""The beginning of ``.npy`` files written here. NumPy's own reader evaluates it as Python, and accepts more:
other types, Python 2's notation."""


def is_packed(path: Path) -> bool:
    """Return whether ``path`` begins like a file that ``pack`` made; raises ``OSError``."""
    with path.open("rb") as file:
        head = file.read(100)
    return head.startswith(b"PK") and MARK in head


def pack(header: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Return a file's content."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        text = json.dumps({"warpsplat": "checkpoint", "format": FORMAT, **header})
        archive.writestr(zipfile.ZipInfo(HEADER), text)
        for name, array in arrays.items():
            part = io.BytesIO()
            np.lib.format.write_array(part, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), part.getbuffer())
    return packed.getvalue()


def unpack(path: Path) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Return the header and arrays of a file that ``pack`` made.

    Raises:
        CheckpointError: It is damaged, or of another version.
        ImageError: It cannot be read.
    """
    data = read_input(path, "a checkpoint")
    try:
        _check_end(data)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            _check_members(members, len(data))
            header = _header(archive.read(members[0]))
            arrays = {info.filename.removesuffix(".npy"): _array(archive.read(info)) for info in members[1:]}
    except CheckpointError as error:
        raise CheckpointError(f"{path}: {error}") from error
    except MemoryError:
        raise
    except Exception as error:  # zipfile, json and NumPy raise many kinds on damaged data
        raise CheckpointError(f"{path}: the checkpoint is damaged: {cut(cause_of(error))}") from error
    return header, arrays


def _check_end(data: bytes) -> None:
    """Raise ``ValueError`` unless the list of members, which is not yet read, is short."""
    end = data[-END:]
    if len(end) < END or end[:4] != b"PK\5\6" or data[-END - LOCATOR :][:4] == b"PK\6\7":
        raise ValueError("its end is missing")
    if int.from_bytes(end[12:16], "little") > LONGEST:
        raise ValueError("it has too many parts")


END, LOCATOR = 22, 20
"""Lengths of a zip archive's end record, and of the locator before it in archives over 4 GiB [bytes]."""


def _check_members(members: list[zipfile.ZipInfo], size: int) -> None:
    """Raise ``ValueError`` unless all members are uncompressed and fit in the file together."""
    if not members or members[0].filename != HEADER or members[0].file_size > LONGEST:
        raise ValueError("it has no header")
    if any(info.compress_type != zipfile.ZIP_STORED or info.flag_bits & 1 for info in members):
        raise ValueError("a part of it is compressed or encrypted")
    if any(info.file_size != info.compress_size for info in members):
        raise ValueError("a part of it has two sizes")
    if sum(info.file_size for info in members) > size:
        raise ValueError("its parts are larger than the file")
    if len({info.filename for info in members}) != len(members):
        raise ValueError("a part of it is there twice")


def _header(text: bytes) -> dict[str, Any]:
    if not text.startswith(MARK):
        raise ValueError("its header is not that of a checkpoint")
    header = json.loads(text)
    if not isinstance(header, dict):
        raise TypeError("its header is no table")
    version = header.get("format")
    if version != FORMAT:
        raise CheckpointError(f"the checkpoint is of format {str(version)[:20]}, this program reads {FORMAT}")
    return header


def _array(data: bytes) -> npt.NDArray[Any]:
    """Return the array of an ``.npy`` file of exactly the right length."""
    found = ARRAY.match(data)
    if not found or int.from_bytes(data[8:10], "little") + 10 != found.end():
        raise ValueError("an array is of an unknown type")
    shape = tuple(int(side) for side in found["shape"].split(b",") if side.strip())
    dtype = np.dtype(found["type"].decode())
    if math.prod(shape) * dtype.itemsize != len(data) - found.end():
        raise ValueError("an array is not as long as it says")
    return np.frombuffer(data, dtype, offset=found.end()).reshape(shape).copy()
