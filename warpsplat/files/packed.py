"""Tables, texts, numbers and arrays in one file, with a digest that tells a damaged one.

The file is ``MARK``, the digest, and an ``.npz`` of NumPy: reading it runs and unpickles nothing.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpsplat.errors import CheckpointError
from warpsplat.files.inputs import read_input

MARK = b"warpsplat checkpoint\n"


def is_packed(path: Path) -> bool:
    """Return whether ``path`` begins like a file that ``pack`` made; raises ``OSError``."""
    with path.open("rb") as file:
        return file.read(len(MARK)) == MARK


def pack(content: Mapping[str, Any]) -> bytes:
    """Return a file of JSON's types and arrays, nested in any way."""
    arrays: list[Any] = []

    def placed(value: Any) -> Any:
        if not value.ndim:  # a number of NumPy's
            return value.item()
        arrays.append(value)
        return {"array": len(arrays)}

    text = json.dumps(content, default=placed)
    made = io.BytesIO()
    np.savez(made, np.frombuffer(text.encode(), np.uint8), *arrays)
    data = made.getvalue()
    return MARK + hashlib.sha256(data).digest() + data


def unpack(path: Path) -> dict[str, Any]:
    """Return what ``pack`` was given; tuples are lists.

    Raises:
        CheckpointError: It is not, byte for byte, what was written.
        ImageError: It cannot be read.
    """
    file = read_input(path, "a checkpoint")
    begin = len(MARK) + hashlib.sha256().digest_size
    head, data = file[:begin], file[begin:]
    if head != MARK + hashlib.sha256(data).digest():
        raise CheckpointError(f"{path}: the checkpoint is damaged")
    with np.load(io.BytesIO(data)) as parts:
        text, *arrays = (parts[name] for name in parts.files)
    content: dict[str, Any] = json.loads(
        text.tobytes(), object_hook=lambda table: arrays[table["array"] - 1] if "array" in table else table
    )
    return content
