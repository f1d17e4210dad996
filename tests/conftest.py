"""One suite, the device chosen outside: ``pytest --device cuda:0``; by default every device found."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

# Fixed before Warp reads it, so that kernels are compiled once and kept between runs of the suite.
os.environ.setdefault("WARP_CACHE_PATH", str(Path(tempfile.gettempdir()) / "warpsplat-test-kernels"))

import pytest
import warp as wp

wp.config.log_level = wp.LOG_ERROR

# What a suite in a shell's background inherits, its programs would ignore too, and run on after Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--device", action="append", default=None, help="Warp devices to test (default: all here)"
    )


@pytest.fixture
def single_precision() -> Iterator[None]:
    """PyTorch as its users find it: the reference renderer makes float64 the default type."""
    import torch

    before = torch.get_default_dtype()
    torch.set_default_dtype(torch.float32)
    yield
    torch.set_default_dtype(before)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "device" in metafunc.fixturenames:
        names = metafunc.config.getoption("--device") or [str(d) for d in wp.get_devices()]
        metafunc.parametrize("device", names)
