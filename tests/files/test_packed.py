"""Files of arrays: they come back, and damaged ones are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from warpsplat.errors import CheckpointError
from warpsplat.files.packed import MARK, is_packed, pack, unpack

POINTS = np.arange(12, dtype=np.float32).reshape(6, 2)
CONTENT = {
    "numbers": [1, 2.5, None, 2**127, np.float32(0.1)],
    "fits": [{"points": POINTS, "kind": np.array([1, 0], np.int32)}, {}],
    "none": np.zeros((0, 3), np.float32),
}
WHOLE = pack(CONTENT)


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(WHOLE)
    assert is_packed(path)
    found = unpack(path)
    assert found["numbers"] == [1, 2.5, None, 2**127, float(np.float32(0.1))]
    fit, empty = found["fits"]
    assert list(fit) == ["points", "kind"] and empty == {}
    for array, expected in ((fit["points"], POINTS), (fit["kind"], [1, 0]), (found["none"], CONTENT["none"])):
        np.testing.assert_array_equal(array, expected)
    assert fit["points"].dtype == np.float32 and fit["kind"].dtype == np.int32


@pytest.mark.parametrize(
    "data",
    [
        MARK,
        WHOLE[:-1],
        WHOLE + b"1",
        WHOLE.replace(np.float32(7).tobytes(), np.float32(6).tobytes(), 1),
        WHOLE[: len(MARK)] + b"0" + WHOLE[len(MARK) + 1 :],
        b"PK" + WHOLE,
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a"
    path.write_bytes(data)
    with pytest.raises(CheckpointError, match="a: the checkpoint is damaged"):
        unpack(path)
