"""``bench``."""

from __future__ import annotations

import json

import pytest

from tests import fake_cuda
from tests.cli.helpers import one_line, run


def test_bench(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--curves", 6, "--size", "48x32", "--repeats", 2, "--threads", 2, "--device", "cpu")
    assert run("bench", *options, "--json") == 0
    values = json.loads(capsys.readouterr().out)
    assert values["threads"] == 2
    assert values["pairs"] > 6
    assert set(values["stages"]) == {"outline", "bins", "forward", "loss", "backward", "update"}
    step = values["step"]
    assert 0 < step["low"] <= step["median"] <= step["high"]


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("renderer", ["exact", "splat"])
def test_bench_table(kind: str, renderer: str, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--curves", 4, "--size", "32x32", "--repeats", 1, "--kind", kind, "--renderer", renderer)
    assert run("bench", *options, "-v") == 0
    shown = capsys.readouterr().out
    assert "megapixels/s" in shown
    assert "composite_backward" in shown


@pytest.mark.needs("torch")
def test_bench_through_torch(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--curves", 4, "--size", "32x32", "--repeats", 1, "--threads", 1, "--device", "cpu", "--torch")
    assert run("bench", *options) == 0
    shown = capsys.readouterr().out
    assert "alternately, torch" in shown
    assert "through PyTorch" in shown


@pytest.mark.slow
@pytest.mark.needs("torch")
def test_bench_through_a_torch_without_cuda(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is said before anything is timed."""
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")  # the test device knows nothing of that
    done = fake_cuda.run("-m", "warpsplat", "bench", "--size", "32x32", "--device", "cuda:0", "--torch")
    assert done.returncode == 2
    assert not done.stdout
    assert "cannot use cuda:0" in one_line(done.stderr)


@pytest.mark.parametrize("size", ["0x10", "10", "16x", "99999x99999", "axb"])
def test_bench_refuses_odd_sizes(size: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("bench", "--size", size) == 2
    assert "not a size" in one_line(capsys.readouterr().err)
