"""Compiled kernels: a damaged cache is made anew, one that cannot be written is replaced."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
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


def empty(path: Path) -> None:
    path.write_bytes(b"")


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 3 : 2 * len(data) // 3 : 7] = bytes(
        b ^ 0x55 for b in data[len(data) // 3 : 2 * len(data) // 3 : 7]
    )
    path.write_bytes(data)


@pytest.mark.slow
def test_a_damaged_cache_is_made_anew(cache: Path) -> None:
    assert doubles()
    good = find(cache, ".o").read_bytes()
    damages: list[tuple[str, Callable[[Path], None]]]
    damages = [(".o", halve), (".o", empty), (".o", flip), (".meta", halve), (".meta", flip)]
    for ending, damage in damages:
        damage(find(cache, ending))
        assert doubles(), (ending, damage)
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
    ask = f"""
        import fcntl, os
        handle = os.open({str(tmp_path / LOCK)!r}, os.O_RDWR)
        for name in ("wp_one", "wp_other"):
            try:
                fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, zlib.crc32(name.encode()))
            except BlockingIOError:
                print(name)
    """

    def held() -> str:
        done = subprocess.run(
            [sys.executable, "-c", "import zlib\n" + textwrap.dedent(ask)],
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout

    assert fcntl
    with alone_with(tmp_path / "wp_one"):
        assert held() == "wp_one\n"
    assert held() == ""
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]
    with alone_with(tmp_path / "none" / "wp_one"):
        pass


def test_what_another_process_compiled_meanwhile_is_only_loaded(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which is seen once the lock is held."""
    assert doubles()
    made, away = find(cache, ".o").parent, cache / "away"
    made.rename(away)

    @contextlib.contextmanager
    def wait(folder: Path) -> Iterator[None]:
        away.rename(folder)
        yield

    monkeypatch.setattr(kernel_cache, "alone_with", wait)
    monkeypatch.setattr(kernel_cache, "compile_by", None)
    assert doubles()
