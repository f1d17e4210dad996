"""Compiled kernels: a damaged cache is made anew, one that cannot be written is replaced."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp

from tests import fake_cuda
from warpsplat.errors import DeviceError, ResourceError
from warpsplat.kernels import constants
from warpsplat.rendering import kernel_cache
from warpsplat.rendering.kernel_cache import LOCK, load

wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers


@wp.kernel
def _double(values: wp.array(dtype=wp.float32)):  # type: ignore[valid-type,no-untyped-def]
    i = wp.tid()
    values[i] = values[i] * 2.0


CPU = wp.get_device("cpu")

NAMESPACE = 'xmlns="http://www.w3.org/2000/svg"'


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
    (path,) = cache.rglob(f"*{ending}")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".o", ".meta"])
def test_a_damaged_cache_is_rebuilt(cache: Path, ending: str) -> None:
    """Files that are cut short, or empty."""
    assert doubles()
    good = find(cache, ".o").read_bytes()
    whole = find(cache, ending).read_bytes()
    for size in (0, 1, len(whole) // 2, len(whole) - 1):
        find(cache, ending).write_bytes(whole[:size])
        assert doubles(), size
        assert find(cache, ".o").read_bytes() == good
    assert len(list(cache.glob("wp_*"))) == 1, "what was damaged is gone"


def test_binaries_of_another_processor_are_not_used(cache: Path) -> None:
    assert doubles()
    own = find(cache, ".o")
    own.rename(own.with_name(f"{own.name.split('.')[0]}.cpu01234567.o"))
    assert doubles()
    assert own.exists() and len(list(own.parent.glob("*.o"))) == 2


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


TWO = """
import sys
from warpsplat.kernels import lanes
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.kernel_cache import load

start_warp()
import warp._src.build as build
build_cpu = build.build_cpu
build.build_cpu = lambda *arguments, **named: (print("compiled"), build_cpu(*arguments, **named))
load(lanes.lane_sums, choose_device("cpu"))
print("loaded")
"""


@pytest.mark.slow
def test_two_processes_share_the_work(tmp_path: Path) -> None:
    both = [
        subprocess.Popen(
            [sys.executable, "-c", TWO],
            env=os.environ | {"WARP_CACHE_PATH": str(tmp_path)},
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    said = sorted(process.communicate()[0].split() for process in both)
    if sys.platform == "win32":
        assert all("loaded" in words for words in said)
    else:
        assert said == [["compiled", "loaded"], ["loaded"]]
    place = find(tmp_path, ".o").parent
    assert {path.name for path in place.parent.iterdir()} == {place.name, LOCK}


DEVICES = """
import sys
from warpsplat.kernels import lanes
from warpsplat.rendering import compiler, kernel_cache
from warpsplat.rendering.device import choose_device, start_warp

start_warp()
compile_later = kernel_cache.compile_later
kernel_cache.compile_later = lambda work: print("compiled") or compile_later(work)
for name in sys.argv[1:]:
    kernel_cache.load(lanes.lane_sums, choose_device(name))
    print(name)
"""


@pytest.mark.slow
def test_each_kind_of_device_has_a_binary_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder that they share: a CPU, GPUs of two architectures, an older driver, which takes no PTX."""
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path))
    done = fake_cuda.run("-c", DEVICES, "cpu", "cuda:0", "cuda:1", devices=2)
    assert done.stdout.split() == ["compiled", "cpu", "compiled", "cuda:0", "cuda:1"], done.stderr
    for options, ending in (({"arch": 80}, ".sm80.ptx"), ({"driver": 13000}, ".sm90.cubin")):
        done = fake_cuda.run("-c", DEVICES, "cuda:0", **options)
        assert done.stdout.split() == ["compiled", "cuda:0"], done.stderr
        assert find(tmp_path, ending)


def test_compiler_errors_are_shown(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Once: another try, or another folder, would not help."""
    tries: list[int] = []

    def refuse(*_: Any, **__: Any) -> None:
        tries.append(1)
        os.write(
            2, b"In file included from double.cpp:1:\ndouble.cpp:7:3: error: unknown type 'floot'\n1 error\n"
        )
        raise Exception("CPU kernel build failed with error code 1")

    monkeypatch.setattr(wp._src.build, "build_cpu", refuse)
    with pytest.raises(DeviceError, match=r"cannot be compiled for the CPU: .*: error: unknown type 'floot'"):
        doubles()
    assert len(tries) == 1 and "WARP_CACHE_PATH" not in caplog.text


@pytest.mark.parametrize(
    ("fail", "words"),
    [("load", "loaded on cuda:0 (Test device): "), ("compile", "compiled for cuda:0 (Test device): ")],
)
def test_driver_errors_are_shown(
    fail: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path))
    (tmp_path / "a.svg").write_text(f'<svg {NAMESPACE} width="20" height="20"><path d="M2 2h9v9z"/></svg>')
    command = ("-m", "warpsplat", "render", "a.svg", "-o", "a.png", "--renderer", "exact")
    done = fake_cuda.run(*command, "--device", "cuda:0", fail=fail, cwd=tmp_path)
    assert done.returncode == 7, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"warpsplat: kernels cannot be {words}") and "kernel cache" not in line
    assert line.endswith("--device cpu does without")
