"""Ctrl-C and SIGTERM at chosen moments: what is written, what is said, what the exit code is."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from warpsplat.svg.viewer import render_svg

pytestmark = [pytest.mark.skipif(os.name != "posix", reason="signals of POSIX"), pytest.mark.slow]

MOMENTS = {
    "import": """
class Finder:
    def find_spec(self, name, *rest):
        if name == "numpy":
            strike()
sys.meta_path.insert(0, Finder())
""",
    "reading": """
import warpsplat.files.inputs
strike_in(warpsplat.files.inputs, "read_input")
""",
    "reading the second input": """
import warpsplat.files.inputs
strike_in(warpsplat.files.inputs, "read_input", 2)
""",
    "compiling": """
import warp
strike_in(warp, "load_module")
""",
    "training": """
from warpsplat.fit.step import Step
strike_in(Step, "advance", 5)
""",
    "writing": """
strike_in(os, "fsync")
""",
    "scoring": """
import warpsplat.jobs.figures
strike_in(warpsplat.jobs.figures, "score_svg")
""",
    "writing, twice": """
strike_in(os, "fsync", times=2)
""",
    "training, ignored": """
import signal
from warpsplat.fit.step import Step
strike_in(Step, "advance", 5)
signal.signal(signal.SIGINT, signal.SIG_IGN)
""",
}
"""What to do so that the signal arrives at that moment."""

DRIVER = """
import os, sys
def strike(times=1):
    for _ in range(times):
        os.kill(os.getpid(), {number})
def strike_in(owner, name, call=1, times=1):
    function, calls = getattr(owner, name), []
    def struck(*arguments, **options):
        calls.append(name)
        if len(calls) == call:
            strike(times)
        return function(*arguments, **options)
    setattr(owner, name, struck)
{moment}
from warpsplat.cli.main import main
main({arguments!r})
"""


def strike(number: int, moment: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    code = DRIVER.format(number=int(number), moment=MOMENTS[moment], arguments=[str(a) for a in arguments])
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert "Traceback" not in done.stderr
    return done


def stray(folder: Path) -> list[str]:
    return [name for name in os.listdir(folder) if name.startswith(".warpsplat")]


RUN = ("--curves", 6, "--iterations", 30, "--device", "cpu", "--json")


@pytest.mark.parametrize(
    ("number", "moment"),
    [
        (signal.SIGINT, "import"),
        (signal.SIGTERM, "reading"),
        (signal.SIGINT, "compiling"),
        (signal.SIGINT, "writing, twice"),
    ],
)
def test_with_nothing_to_save_nothing_is_written(image: Path, number: signal.Signals, moment: str) -> None:
    done = strike(number, moment, "vectorize", image, "-o", image.parent / "a.svg", *RUN)
    assert done.returncode == 128 + number
    assert done.stderr.split() == ["warpsplat:", "interrupted"]
    # A second signal ends the process at once.
    answer = "" if "twice" in moment else f'{{"error": "interrupted", "exit_code": {128 + number}}}\n'
    assert done.stdout == answer
    assert os.listdir(image.parent) == ["photo.png"]


@pytest.mark.parametrize(
    ("number", "moment", "finished"),
    [
        (signal.SIGTERM, "training", False),
        (signal.SIGTERM, "writing", True),
        (signal.SIGINT, "scoring", True),
    ],
)
def test_what_is_there_is_written(image: Path, number: signal.Signals, moment: str, finished: bool) -> None:
    output = image.parent / "a.svg"
    done = strike(number, moment, "vectorize", image, "-o", output, *RUN)
    assert done.returncode == 128 + number, done.stderr
    values = json.loads(done.stdout)
    assert values["stopped"] is not finished
    assert values["iterations"] == (30 if finished else 5)
    assert (values["psnr"] is None) == (moment == "writing"), (
        "the score is given up, but a started one is short"
    )
    text = output.read_text()
    assert ("stopped" not in text) == finished, "what was cut short does not pass for a finished result"
    assert values["bytes"] == len(text)
    render_svg(text)
    assert not stray(image.parent)


@pytest.mark.parametrize(
    ("number", "moment"), [(signal.SIGTERM, "training"), (signal.SIGINT, "reading the second input")]
)
def test_a_batch_ends_with_its_summary(image: Path, number: signal.Signals, moment: str) -> None:
    """The first input is the list of jobs, the second the first image."""
    (image.parent / "b.png").write_bytes(image.read_bytes())
    jobs = image.parent / "jobs.yaml"
    jobs.write_text("jobs: [{images: '*.png', curves: 6, iterations: 30, device: cpu}]")
    done = strike(number, moment, "batch", jobs, "--json")
    assert done.returncode == 128 + number
    results = [json.loads(line) for line in done.stdout.splitlines()][:-1]
    assert [(Path(r["image"]).name, r["status"]) for r in results] == [("b.png", "stopped")]
    assert (image.parent / "b.svg").exists() == (moment == "training")
    assert not (image.parent / "photo.svg").exists()


def test_an_ignored_signal_stays_ignored(image: Path) -> None:
    """As ``nohup`` and a shell's background jobs set it."""
    done = strike(signal.SIGINT, "training, ignored", "vectorize", image, "-o", image.parent / "a.svg", *RUN)
    assert done.returncode == 0
    assert json.loads(done.stdout)["iterations"] == 30


@pytest.mark.parametrize("seed", range(2))
def test_ctrl_c_at_any_early_moment_shows_no_traceback(image: Path, seed: int) -> None:
    command = [sys.executable, "-X", "importtime", "-m", "warpsplat", "vectorize", str(image), "-q"]
    process = subprocess.Popen(
        [*command, "-o", str(image.parent / "a.svg"), "--iterations", "900000", "--device", "cpu"],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
    )
    assert process.stderr
    for line in process.stderr:
        if b"click" in line:  # the first import after the one that prepares for signals
            break
    time.sleep(random.Random(seed).uniform(0, 0.3))
    process.send_signal(signal.SIGINT)
    try:
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert b"Traceback" not in said
    assert process.returncode in {130, -signal.SIGINT}


def test_killed_while_writing_leaves_nothing_for_long(image: Path) -> None:
    output = image.parent / "a.svg"
    done = strike(signal.SIGKILL, "writing", "vectorize", image, "-o", output, *RUN)
    assert done.returncode == -signal.SIGKILL
    assert len(stray(image.parent)) == 1
    assert not output.exists()
    assert strike(0, "writing", "vectorize", image, "-o", output, *RUN).returncode == 0
    assert not stray(image.parent)
