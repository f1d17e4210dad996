"""``bench``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests import ROOT, fake_cuda
from tests.cli.helpers import one_line, run
from warpsplat.tools import against


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


def folder_with_a_copy(folder: Path) -> Path:
    """Return a folder from which warpsplat is imported as another copy."""
    (folder / "warpsplat").symlink_to(ROOT / "warpsplat")
    return folder


SMALL = ("--curves", 3, "--size", "32x32", "--repeats", 1, "--rounds", 2, "--threads", 1, "--device", "cpu")


def test_bench_against_another_copy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = folder_with_a_copy(tmp_path)
    assert run("bench", *SMALL, "--against", folder, "--json") == 0
    values = json.loads(capsys.readouterr().out)
    this, other = values["sides"]
    assert other["folder"] == str(folder)
    assert this["folder"] != other["folder"]
    assert this["versions"] == other["versions"]
    assert values["processor"]
    for name in ("step", "forward_backward", "backward"):
        ratio = values["ratios"][name]
        assert 0 < ratio["low"] <= ratio["median"] <= ratio["high"]
        times = [side["times"][name] for side in (this, other)]
        assert times[1]["low"] / times[0]["high"] <= ratio["high"] * 1.01


def test_bench_against_is_a_table_of_both(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second side takes twice as long, whichever begins a round."""
    order: list[str] = []

    def answer(side: against.Side, command: str, *arguments: str) -> dict[str, Any]:
        if command == "info":
            return {"warpsplat": "1", "warp": "2", "python": "3"}
        order.append(side.device)
        time = dict.fromkeys(("median", "low", "high"), 2.0 if side.device == "cuda:0" else 1.0)
        scene = {"kind": "open", "shapes": 3, "width": 32, "height": 32, "opacity": 0.5, "renderer": "exact"}
        where = {"device": side.device, "device_name": "a name", "threads": 1}
        return {**scene, **where, "step": time, "forward_backward": time, "stages": {"loss": time}}

    monkeypatch.setattr(against.Side, "run", answer)
    assert run("bench", *SMALL, "--against", "cuda:0") == 0
    lines = capsys.readouterr().out.splitlines()
    assert order == ["cpu", "cuda:0", "cuda:0", "cpu"]
    assert lines[2].startswith("other: warpsplat 1 of ")
    assert lines[2].endswith("cuda:0 (a name)")
    assert lines[4].split() == [
        "step",
        "1.00",
        "1.00",
        "1.00",
        "2.00",
        "2.00",
        "2.00",
        "2.00",
        "2.00",
        "2.00",
    ]
    assert lines[-1] == "a step of the other takes 2.00 times as long"


@pytest.mark.parametrize(
    ("other", "message"),
    [("nothing/like/it", "is no device"), (".", "no folder with a warpsplat"), ("cuda:77", "cuda:77")],
)
def test_bench_against_what_there_is_not(
    other: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("bench", *SMALL, "--against", other) == 2
    assert message in one_line(capsys.readouterr().err)
