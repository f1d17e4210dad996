"""Runs that a signal ends: the old file, none or a whole one, the code of the signal, and nothing stray."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from tests import ROOT
from tests.forks import MOMENTS, QUICK, Forks, Task, make_image
from warpsplat.jobs.batch.manifest import NAME
from warpsplat.svg.viewer import render_svg

pytestmark = pytest.mark.slow

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -signal.SIGKILL}
GENTLE = [signal.SIGINT, signal.SIGTERM]
TRAINING = {"vectorize": 60, "batch": 125}
"""Launches of kernels until the middle of the training, of a batch that of its second image."""
BATCH = f"defaults: {{device: cpu, curves: 4, iterations: {QUICK[-1]}}}\njobs: [{{images: '*.png'}}]\n"


def lay_out(folder: Path, command: str) -> list[str]:
    """Make the inputs of a command; its arguments."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed, name in enumerate(("a.png", "b.png") if command == "batch" else ("a.png",)):
        make_image(folder / name, seed)
    if command == "batch":
        (folder / "jobs.yaml").write_text(BATCH)
        return ["batch", "jobs.yaml"]
    return ["vectorize", "a.png", "-o", "a.svg", *QUICK]


def results(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.svg")}


class Runner(Forks):
    """With the results of undisturbed runs."""

    def __init__(self, scratch: Path) -> None:
        super().__init__(scratch)
        self.whole: dict[str, dict[str, bytes]] = {}
        for command in ("vectorize", "batch"):
            folder = scratch / command
            code, _, said = self.run(lay_out(folder, command), folder)
            assert code == 0, said
            self.whole[command] = results(folder)
            assert self.whole[command]


@pytest.fixture(scope="module")
def runner(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runner]:
    made = Runner(tmp_path_factory.mktemp("signals"))
    yield made
    made.close()


def assert_whole(folder: Path) -> None:
    """Every result that is there is a whole SVG, and there is nothing but inputs and results."""
    for data in results(folder).values():
        assert data.rstrip().endswith(b"</svg>")
        assert render_svg(data.decode(), width=32, height=24).size == (32, 24)
    stray = [n for n in os.listdir(folder) if not n.endswith((".png", ".svg", ".yaml", NAME))]
    assert not stray


def assert_mended(runner: Runner, command: str, arguments: list[str], folder: Path) -> None:
    """The next run makes what an undisturbed one makes, and clears away what was left."""
    code, _, said = runner.run(arguments, folder)
    assert code == 0, said
    assert results(folder) == runner.whole[command]
    assert_whole(folder)


@pytest.mark.parametrize("number", CODES)
@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("command", ["vectorize", "batch"])
def test_a_signal_at_a_stage(
    runner: Runner, tmp_path: Path, command: str, moment: str, number: signal.Signals
) -> None:
    arguments = lay_out(tmp_path, command)
    # Of a batch, into its second image.
    count = {"training": TRAINING[command], "loading": 1}.get(moment, 2 if command == "batch" else 1)
    code, _, said = runner.run(arguments, tmp_path, moment=moment, count=count, signal=number)
    assert code == CODES[number], said
    assert "Traceback" not in said
    if number in GENTLE:
        assert_whole(tmp_path)
        if moment != "loading":
            made = runner.whole[command] if command == "vectorize" else {"a.svg": b""}
            assert set(results(tmp_path)) >= set(made), "the best so far is written"
    assert_mended(runner, command, arguments, tmp_path)


@pytest.mark.parametrize("number", CODES)
@pytest.mark.parametrize("moment", ["writing", "renaming"])
def test_an_old_result_is_kept_or_replaced(
    runner: Runner, tmp_path: Path, moment: str, number: signal.Signals
) -> None:
    arguments = lay_out(tmp_path, "vectorize")
    old = runner.whole["vectorize"]["a.svg"]
    (tmp_path / "a.svg").write_bytes(old)
    arguments += ["--curves", "5"]
    code, _, said = runner.run(arguments, tmp_path, moment=moment, signal=number)
    assert code == CODES[number], said
    after = (tmp_path / "a.svg").read_bytes()
    assert after == old or (number in GENTLE and after.count(b"<path") == 5)
    assert runner.run(arguments, tmp_path)[0] == 0
    assert (tmp_path / "a.svg").read_bytes().count(b"<path") == 5
    assert_whole(tmp_path)


@pytest.mark.parametrize("command", ["vectorize", "batch"])
def test_an_ignored_ctrl_c_stays_ignored(runner: Runner, tmp_path: Path, command: str) -> None:
    """Under ``nohup``, or in the background of a script."""
    arguments = lay_out(tmp_path, command)
    trip: dict[str, Any] = {"moment": "training", "count": TRAINING[command], "signal": signal.SIGINT}
    code, _, said = runner.run(arguments, tmp_path, ignored=True, **trip)
    assert code == 0, said
    assert results(tmp_path) == runner.whole[command]


@pytest.mark.parametrize("number", GENTLE)
@pytest.mark.parametrize("moment", ["import click", "import numpy", "import warp", "loading"])
def test_a_signal_at_the_start(tmp_path: Path, moment: str, number: signal.Signals) -> None:
    folder = tmp_path / "folder"
    arguments = lay_out(folder, "vectorize")
    err = tmp_path / "stderr"
    task = Task(arguments, str(folder), os.devnull, str(err), moment=moment, signal=number)
    command = [sys.executable, "-m", "tests.forks", json.dumps(asdict(task))]
    done = subprocess.run(command, cwd=ROOT, check=False)
    said = err.read_text()
    # Before the program's first line the system's own answer is the right one; a shell says the same of both.
    assert done.returncode in (CODES[number], -number), said
    assert "Traceback" not in said
    assert len(said.strip().splitlines()) <= 1, said
    assert_whole(folder)
