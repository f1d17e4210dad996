"""Runs ended by a signal leave the old file, none or a whole one, and nothing stray."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from tests import ROOT, make_image
from tests.cli.helpers import MANIFEST
from tests.forks import MOMENTS, QUICK, Forks, Task
from warpsplat.svg.viewer import render_own

pytestmark = pytest.mark.slow

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -signal.SIGKILL}
GENTLE = [signal.SIGINT, signal.SIGTERM]
COMMANDS = ("vectorize", "batch")
EARLY = ("decoding", "loading")
"""Moments before there is anything to write."""
TRAINING = {"vectorize": 60, "batch": 125}
"""Kernel launches until the middle of the training; of the second image of a batch."""
STEPS = int(QUICK[-1])
BATCH = f"defaults: {{device: cpu, curves: 4, iterations: {STEPS}}}\njobs: [{{images: '*.png'}}]\n"


def lay_out(folder: Path, command: str) -> list[str]:
    """Make the inputs of a command; return its arguments."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed, name in enumerate(("a.png", "b.png") if command == "batch" else ("a.png",)):
        make_image(folder / name, seed)
    if command == "batch":
        (folder / "jobs.yaml").write_text(BATCH)
        return ["batch", "jobs.yaml"]
    return ["vectorize", "a.png", "-o", "a.svg", *QUICK]


def results(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.svg")}


@pytest.fixture(scope="module")
def undisturbed(forks: Forks, tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, bytes]]:
    """Results of each command without a signal."""
    made = {}
    for command in COMMANDS:
        folder = tmp_path_factory.mktemp(command)
        code, _, said = forks.run(lay_out(folder, command), folder)
        assert code == 0, said
        made[command] = results(folder)
        assert made[command]
    return made


def assert_whole(folder: Path) -> None:
    """Check that every result is a whole SVG, and that there are only inputs and results."""
    for data in results(folder).values():
        assert data.rstrip().endswith(b"</svg>")
        assert render_own(data.decode()).size == (32, 24)
    stray = [n for n in os.listdir(folder) if not n.endswith((".png", ".svg", ".yaml", MANIFEST))]
    assert not stray


SIGNALS = [
    (command, moment, number)
    for i, command in enumerate(COMMANDS)
    for j, moment in enumerate(MOMENTS)
    for number in (GENTLE[(i + j) % 2], signal.SIGKILL)
]
"""Ctrl-C and SIGTERM alternate: the same code handles both."""


@pytest.mark.parametrize(("command", "moment", "number"), SIGNALS)
def test_a_signal_at_a_stage(
    forks: Forks,
    undisturbed: dict[str, dict[str, bytes]],
    tmp_path: Path,
    command: str,
    moment: str,
    number: signal.Signals,
) -> None:
    arguments = lay_out(tmp_path, command)
    # A batch is interrupted in its second image.
    count = {"training": TRAINING[command], "loading": 1}.get(moment, 2 if command == "batch" else 1)
    code, _, said = forks.run(arguments, tmp_path, moment=moment, count=count, signal=number)
    assert code == CODES[number], said
    assert "Traceback" not in said
    if number in GENTLE:
        assert_whole(tmp_path)
        if moment not in EARLY:
            made = undisturbed[command] if command == "vectorize" else {"a.svg": b""}
            assert set(results(tmp_path)) >= set(made), "the best so far is written"
    # The next run makes what an undisturbed one makes, and clears away what was left.
    code, _, said = forks.run(arguments, tmp_path)
    assert code == 0, said
    assert results(tmp_path) == undisturbed[command]
    assert_whole(tmp_path)


@pytest.mark.parametrize(
    ("number", "moment", "finished"),
    [
        (signal.SIGTERM, "training", False),
        (signal.SIGTERM, "writing", True),
        (signal.SIGINT, "scoring", True),
    ],
)
def test_the_best_so_far_is_written_and_marked(
    forks: Forks, tmp_path: Path, number: signal.Signals, moment: str, finished: bool
) -> None:
    arguments = [*lay_out(tmp_path, "vectorize"), "--json"]
    count = TRAINING["vectorize"] if moment == "training" else 1
    code, out, said = forks.run(arguments, tmp_path, moment=moment, count=count, signal=number)
    assert code == CODES[number], said
    values = json.loads(out)
    assert values["stopped"] is not finished
    assert (values["iterations"] == STEPS) is finished
    assert values["iterations"] > 0
    assert values["psnr"] > 5, "scoring a small image takes no time"
    text = (tmp_path / "a.svg").read_text()
    assert ("stopped" not in text) == finished, "what was cut short does not pass for a finished result"
    assert values["bytes"] == len(text)


@pytest.mark.parametrize(("number", "times"), [(signal.SIGTERM, 1), (signal.SIGINT, 2)])
def test_nothing_is_written_without_results(
    forks: Forks, tmp_path: Path, number: signal.Signals, times: int
) -> None:
    """A second signal ends the process at once, even where there would be something."""
    arguments = [*lay_out(tmp_path, "vectorize"), "--json"]
    moment = "decoding" if times == 1 else "writing"
    code, out, said = forks.run(arguments, tmp_path, moment=moment, signal=number, times=times)
    assert code == CODES[number]
    assert said.strip() == "warpsplat: interrupted"
    answer = {"error": "interrupted", "exit_code": CODES[number]}
    assert [json.loads(line) for line in out.splitlines()] == [answer] * (times == 1)
    assert os.listdir(tmp_path) == ["a.png"]


@pytest.mark.parametrize("moment", ["decoding", "training"])
def test_a_batch_ends_with_its_summary(forks: Forks, tmp_path: Path, moment: str) -> None:
    arguments = [*lay_out(tmp_path, "batch"), "--json"]
    count = TRAINING["vectorize"] if moment == "training" else 1
    code, out, _ = forks.run(arguments, tmp_path, moment=moment, count=count, signal=signal.SIGINT)
    assert code == CODES[signal.SIGINT]
    *images, summary = map(json.loads, out.splitlines())
    assert [(image["image"], image["status"]) for image in images] == [("a.png", "stopped")]
    assert "status" not in summary
    assert list(results(tmp_path)) == (["a.svg"] if moment == "training" else [])


@pytest.mark.parametrize("number", CODES)
@pytest.mark.parametrize("moment", ["writing", "renaming"])
def test_an_old_result_is_kept_or_replaced(
    forks: Forks,
    undisturbed: dict[str, dict[str, bytes]],
    tmp_path: Path,
    moment: str,
    number: signal.Signals,
) -> None:
    arguments = lay_out(tmp_path, "vectorize")
    old = undisturbed["vectorize"]["a.svg"]
    (tmp_path / "a.svg").write_bytes(old)
    arguments += ["--curves", "5"]
    code, _, said = forks.run(arguments, tmp_path, moment=moment, signal=number)
    assert code == CODES[number], said
    after = (tmp_path / "a.svg").read_bytes()
    assert after == old or (number in GENTLE and after.count(b"<path") == 5)
    assert forks.run(arguments, tmp_path)[0] == 0
    assert (tmp_path / "a.svg").read_bytes().count(b"<path") == 5
    assert_whole(tmp_path)


@pytest.mark.parametrize("command", COMMANDS)
def test_an_ignored_ctrl_c_stays_ignored(
    forks: Forks, undisturbed: dict[str, dict[str, bytes]], tmp_path: Path, command: str
) -> None:
    """Under ``nohup``, or in the background of a script."""
    arguments = lay_out(tmp_path, command)
    trip: dict[str, Any] = {"moment": "training", "count": TRAINING[command], "signal": signal.SIGINT}
    code, _, said = forks.run(arguments, tmp_path, ignored=True, **trip)
    assert code == 0, said
    assert results(tmp_path) == undisturbed[command]


@pytest.mark.parametrize("number", GENTLE)
@pytest.mark.parametrize("moment", ["import click", "import numpy", "import warp"])
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
