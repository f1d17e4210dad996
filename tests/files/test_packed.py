"""Files of arrays: they come back, and damaged ones are refused cheaply."""

from __future__ import annotations

import io
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from warpsplat.errors import CheckpointError
from warpsplat.files import packed
from warpsplat.files.packed import HEADER, is_packed, pack, unpack

ARRAYS = {
    "0/points": np.arange(12, dtype=np.float32).reshape(6, 2),
    "0/kind": np.array([1, 0], np.int32),
    "none": np.zeros((0, 3), np.float32),
}
WHOLE = pack({"numbers": [1, 2.5, None, 2**127]}, ARRAYS)


def test_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(WHOLE)
    assert is_packed(path)
    header, arrays = unpack(path)
    assert header["numbers"] == [1, 2.5, None, 2**127]
    assert list(arrays) == list(ARRAYS)
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(arrays[name], array)
        assert arrays[name].dtype == array.dtype
    with np.load(path) as found:
        np.testing.assert_array_equal(found["0/kind"], ARRAYS["0/kind"])


def archive(*members: tuple[str, bytes], how: int = zipfile.ZIP_STORED) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", how) as file:
        for name, data in members:
            file.writestr(name, data)
    return made.getvalue()


def npy(array: np.ndarray) -> bytes:
    made = io.BytesIO()
    np.lib.format.write_array(made, array)
    return made.getvalue()


HEAD = (HEADER, b'{"warpsplat": "checkpoint", "format": 1}')
SMALL = np.zeros(4, np.float32)


class Bomb:
    """An object that must never be unpickled."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return pytest.fail, ("unpickled",)


@pytest.mark.parametrize(
    ("data", "cause"),
    [
        (b"PK", "its end is missing"),
        (WHOLE[:-1], "its end is missing"),
        (WHOLE[:-30] + WHOLE[-22:], "damaged"),
        (WHOLE.replace(b"0/points", b"0/pointz", 1), "differ"),
        (WHOLE.replace(np.float32(7).tobytes(), np.float32(6).tobytes(), 1), "CRC"),
        (archive(("a.txt", b"hello")), "no header"),
        (archive((HEADER, b"{}")), "not that of a checkpoint"),
        (archive((HEADER, HEAD[1][:-1])), "delimiter"),
        (archive((HEADER, HEAD[1][:-1] + b', "a":' + b"[" * 100_000)), "damaged"),
        (archive((HEADER, HEAD[1][:-2] + b'7}')), "format 7, this program reads 1"),
        (archive(HEAD, ("a.npy", npy(SMALL)), how=zipfile.ZIP_DEFLATED), "compressed"),
        (archive(HEAD, ("a.npy", npy(SMALL).replace(b"(4,)", b"(9999999999,)"))), "unknown type"),
        (archive(HEAD, ("a.npy", npy(SMALL).replace(b"(4,), ", b"(-4,),"))), "unknown type"),
        (archive(HEAD, ("a.npy", npy(SMALL)[:-1])), "as long as it says"),
        (archive(HEAD, ("a.npy", npy(SMALL) + b"1")), "as long as it says"),
        (archive(HEAD, ("a.npy", npy(SMALL.astype(np.float64)))), "unknown type"),
        (archive(HEAD, ("a.npy", npy(np.asfortranarray(np.zeros((2, 3), np.float32))))), "unknown type"),
        (archive(HEAD, ("a.npy", npy(np.array([Bomb()], object)))), "unknown type"),
        (archive(HEAD, ("a.npy", npy(SMALL).replace(b"(4,), }  ", b"(99,), } "))), "as long as it says"),
        (archive(HEAD, ("a.npy", b"")), "unknown type"),
        (archive(HEAD, ("a.npy", b"\x93NUMPY\2\0" + npy(SMALL)[8:])), "unknown type"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused(tmp_path: Path, data: bytes, cause: str) -> None:
    path = tmp_path / "a"
    path.write_bytes(data)
    with pytest.raises(CheckpointError, match=f"a: the checkpoint is .*{cause}"):
        unpack(path)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_nothing_is_larger_than_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither a bomb, nor overlapping members, nor a long list of members."""
    monkeypatch.setattr(packed, "read_input", lambda path, what: path.read_bytes())
    path = tmp_path / "a"
    bomb = archive(HEAD, ("a.npy", npy(np.zeros(5_000_000, np.float32))), how=zipfile.ZIP_DEFLATED)
    twice = archive(HEAD, ("a.npy", npy(SMALL)), ("a.npy", npy(SMALL)))
    many = bytearray(WHOLE)
    many[-10:-6] = (1 << 30).to_bytes(4, "little")
    for data, cause in ((bomb, "compressed"), (twice, "there twice"), (bytes(many), "too many parts")):
        path.write_bytes(data)
        tracemalloc.start()
        with pytest.raises(CheckpointError, match=cause):
            unpack(path)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert most < 4_000_000
