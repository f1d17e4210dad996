"""Compiled kernels: a damaged cache is made anew, one that cannot be written is replaced."""

from __future__ import annotations

import os
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpsplat.errors import ResourceError
from warpsplat.kernels import constants
from warpsplat.rendering import kernel_cache
from warpsplat.rendering.kernel_cache import CHECKSUMS, LOCK, alone_with, load

wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers


@wp.kernel
def _double(values: wp.array(dtype=wp.float32)):  # type: ignore[valid-type,no-untyped-def]
    i = wp.tid()
    values[i] = values[i] * 2.0


CPU = wp.get_device("cpu")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache of this test's own."""
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "_temporary", [])
    _double.module.unload()
    yield tmp_path
    _double.module.unload()


def doubles() -> bool:
    """Load the kernel, as a new process would, and run it."""
    _double.module.unload()
    load(_double, CPU)
    values = wp.array([1.0, 2.0], dtype=wp.float32, device=CPU)
    wp.launch(_double, dim=2, inputs=[values], device=CPU)
    return bool(np.array_equal(values.numpy(), [2.0, 4.0]))


def find(cache: Path, ending: str) -> Path:
    (path,) = (p for p in cache.rglob(f"*{ending}") if p.name != CHECKSUMS)
    return path


def halve(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.slow
def test_a_damaged_cache_is_rebuilt(cache: Path) -> None:
    """Files that are cut short, empty, or have other bytes."""
    assert doubles()
    good = find(cache, ".o").read_bytes()
    for ending in (".o", ".meta"):
        whole = find(cache, ending).read_bytes()
        third = len(whole) // 3
        for damaged in (whole[: 2 * third], b"", whole[:third] + bytes(third) + whole[2 * third :]):
            find(cache, ending).write_bytes(damaged)
            assert doubles(), (ending, len(damaged))
            assert find(cache, ".o").read_bytes() == good
    assert len(list(cache.glob("wp_*"))) == 1, "what was damaged is gone"


def test_damage_from_before_the_checksums_is_found_where_it_shows(cache: Path) -> None:
    assert doubles()
    for ending in (".o", ".meta"):
        (find(cache, ".o").parent / CHECKSUMS).unlink()
        halve(find(cache, ending))
        assert doubles()


def test_a_whole_cache_is_used_as_it_is(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert doubles()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("compiled again")

    monkeypatch.setattr(_double.module, "_run_codegen", refuse)
    assert doubles()


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_is_replaced(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (cache / "file").touch()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(cache / "file"))
    assert doubles()
    assert [r.levelname for r in caplog.records if "for this run only" in r.message] == ["WARNING"]
    assert str(cache / "file") in caplog.text
    assert "WARP_CACHE_PATH" in caplog.text


def test_without_any_place_the_message_names_the_cache(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (cache / "file").touch()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(cache / "file"))

    def full(*_: object, **__: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr("tempfile.mkdtemp", full)
    with pytest.raises(ResourceError, match=r"kernel cache .*file: .*WARP_CACHE_PATH") as caught:
        doubles()
    assert caught.value.exit_code == 7


def test_a_module_is_compiled_by_one_process(tmp_path: Path) -> None:
    """By a lock of its own, which is no obstacle where there is no cache."""
    fcntl = pytest.importorskip("fcntl")

    def is_held(name: str) -> bool:
        byte = zlib.crc32(name.encode())
        handle = f"open({str(tmp_path / LOCK)!r}, 'r+')"
        lock = f"fcntl.lockf({handle}, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, {byte})"
        asked = subprocess.run(
            [sys.executable, "-c", f"import fcntl; {lock}"], capture_output=True, check=False
        )
        return b"BlockingIOError" in asked.stderr

    assert fcntl
    with alone_with(tmp_path / "wp_one"):
        assert is_held("wp_one")
        assert not is_held("wp_other")
    assert not is_held("wp_one")
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]
    with alone_with(tmp_path / "none" / "wp_one"):
        pass
