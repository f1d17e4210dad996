"""One suite, the device chosen outside: ``pytest --device cuda:0``; by default every device found.

``--device fake-cuda`` is a CUDA device without a GPU, see ``tests/fake_cuda``.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# Fixed before Warp reads it, so that kernels are compiled once and kept between runs of the suite.
os.environ.setdefault("WARP_CACHE_PATH", str(Path(tempfile.gettempdir()) / "warpsplat-test-kernels"))

from tests import fake_cuda
from tests.fake_cuda import plugin  # before Warp is imported

# isort: split

import numpy as np
import pytest
import warp as wp
from PIL import Image

from tests import needs, smoke

wp.config.log_level = wp.LOG_ERROR

SEEDS_APART = 1000
"""Between those of ``--fit-seed`` N and N + 1: more than tests and runs count up from one seed."""

# What a suite in a shell's background inherits, its programs would ignore too, and run on after Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--device",
        action="append",
        default=None,
        help=f"Warp devices to test (default: all here); {fake_cuda.NAME}: see tests/fake_cuda",
    )
    parser.addoption(
        "--gpu-lanes", action="store_true", help="divide tiles on a CPU as on a GPU, which rounds differently"
    )
    parser.addoption(
        "--fit-seed",
        type=int,
        default=0,
        metavar="N",
        help="other random numbers in fits and in the scenes of tests/scenes.py (0: the usual ones)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Divide tiles as on a GPU, if asked for. Shift the seeds of generators that the package and
    ``tests.scenes`` make, in this process.

    A test whose bound holds for one series of random numbers only would fail on a machine that rounds
    otherwise; ``--fit-seed`` finds it here.
    """
    if plugin.ACTIVE:
        config.pluginmanager.register(plugin)
    if config.getoption("--gpu-lanes"):
        from tests.lanes import divide_as_on_gpu  # imports the package

        divide_as_on_gpu(pytest.MonkeyPatch())
    shift = config.getoption("--fit-seed")
    if not shift:
        return
    original = np.random.default_rng

    def shifted(seed: Any = None) -> np.random.Generator:
        module = sys._getframe(1).f_globals.get("__name__", "")
        drawn = module.startswith("warpsplat.") or module == "tests.scenes"
        return original(seed + SEEDS_APART * shift if drawn and isinstance(seed, int) else seed)

    np.random.default_rng = shifted


@pytest.fixture
def single_precision() -> Iterator[None]:
    """PyTorch as its users find it: the reference renderer makes float64 the default type."""
    import torch

    before = torch.get_default_dtype()
    torch.set_default_dtype(torch.float32)
    yield
    torch.set_default_dtype(before)


@pytest.fixture
def cli(capfd: pytest.CaptureFixture[str]) -> Any:
    from tests.cli.helpers import Said, run

    def ran(*arguments: object, code: int = 0) -> Said:
        capfd.readouterr()
        assert run(*arguments) == code
        return Said(*capfd.readouterr())

    return ran


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """With grain, so that it is taken for a photograph."""
    path = tmp_path / "photo.png"
    y, x = np.mgrid[:40, :60]
    smooth = np.stack([4 * x, 6 * y, 0 * x + 90], axis=2)
    grain = np.random.default_rng(0).normal(0, 4, smooth.shape)
    Image.fromarray(np.clip(smooth + grain, 0, 255).astype(np.uint8)).save(path)
    return path


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    return needs.needs_missing(collection_path) or None


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        if item.nodeid.startswith(smoke.NAMES):
            item.add_marker("smoke")
    for item in items:
        marked = {mark.args[0] for mark in item.iter_markers("needs")}
        words = set(needs.words_of(dict(item.callspec.params))) if hasattr(item, "callspec") else set()
        if marked & needs.MISSING or words & needs.ABSENT_WORDS:
            item.add_marker(pytest.mark.skip(reason="needs an extension that is not there"))
    if config.getoption("--fit-seed") or config.getoption("--gpu-lanes"):
        left_out = [item for item in items if item.get_closest_marker("usual_seed")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "device" in metafunc.fixturenames:
        names = metafunc.config.getoption("--device") or [str(d) for d in wp.get_devices()]
        metafunc.parametrize("device", ["cuda:0" if name == fake_cuda.NAME else name for name in names])
