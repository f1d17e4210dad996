"""Commands that optimise: progress, goals, threads, Ctrl-C, checkpoints."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cli.helpers import QUICK, Cli, python, run
from tests.runs import vectorize
from warpsplat.cli.run import Bar
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import make_settings
from warpsplat.fit.step import Step
from warpsplat.native import available_cores
from warpsplat.rendering.backend import THREADS_PER_CORE, Backend
from warpsplat.svg.viewer import render_svg


@pytest.mark.slow
def test_ctrl_c_writes_the_best_so_far(image: Path, tmp_path: Path) -> None:
    """The progress bar shows in a terminal, Ctrl-C ends the run, the file is there and valid."""
    output = tmp_path / "a.svg"
    command = [sys.executable, "-m", "warpsplat", "vectorize", str(image), "-o", str(output)]
    primary, secondary = pty.openpty()
    process = subprocess.Popen(
        [*command, "--curves", "8", "--iterations", "900000", "--device", "cpu"],
        stdout=subprocess.PIPE,
        stderr=secondary,
        text=True,
    )
    os.close(secondary)
    shown = b""
    deadline = time.monotonic() + 120
    while b"dB" not in shown and time.monotonic() < deadline:
        shown += os.read(primary, 1000)
    assert b"photo.png" in shown
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    os.close(primary)
    assert process.returncode == 130
    assert "stopped after" in out
    render_svg(output.read_text())


def test_many_threads_are_bounded(image: Path) -> None:
    assert run("vectorize", image, "-o", image.parent / "a.svg", "--threads", 10**6, *QUICK) == 0
    assert threading.active_count() <= 1 + 2 * THREADS_PER_CORE * available_cores()


def test_the_bar_shows_the_time_left_and_no_decibels_that_fall() -> None:
    """The decibels of coarse steps are a reduced image's."""
    bar = Bar()
    steps = [(0.1, 20.0, False), (0.35, 30.0, False), (0.6, 25.0, True), (1.0, 24.0, True)]
    given = [Progress(i, 4, psnr, 0.0, work, fine) for i, (work, psnr, fine) in enumerate(steps)]
    texts = [bar.update(progress, 30.0 + 100 * progress.work) for progress in given]
    assert texts == [
        "reduced image",
        "1:05 left, reduced image",
        "0:40 left, 25.00 dB",
        "0:00 left, 25.00 dB",
    ]


def test_work_weighs_steps_by_their_pixels() -> None:
    settings = make_settings(curves=6, iterations=100, coarse=0.5, coarse_pixels=600, density={"interval": 0})
    seen: list[Progress] = []
    vectorize(np.full((40, 60, 3), 0.5, np.float32), settings, Backend.on("cpu", 1), report=seen.append)
    assert [p.fine for p in seen] == [False] * 5 + [True] * 5
    work = [p.work for p in seen]
    coarse, fine = np.diff(work[:5]), np.diff(work[5:])  # with a quarter of the pixels, and with all
    assert fine / coarse.mean() == pytest.approx(2, rel=0.1) and work[-1] == 1


@pytest.mark.slow
def test_compiling_is_reported_on_a_terminal_or_with_v(image: Path, tmp_path: Path) -> None:
    options = ("vectorize", image, "-o", image.parent / "a.svg", *QUICK, "--iterations", 1)
    code = "from warp._src.context import Module; Module._compile = lambda *_, **__: exit(9)\n"
    code += f"from warpsplat.cli.main import main; main({[str(o) for o in options]!r} + ARGS)"
    for arguments, said in (([], False), (["-v"], True)):
        cache = str(tmp_path / "cache")
        done = python("-c", code.replace("ARGS", repr(arguments)), WARP_CACHE_PATH=cache)
        assert done.returncode == 9
        assert (b"compiling kernels" in done.stderr) is said


pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")

RUN = (*QUICK, "--subject", "photo", "-q", "--checkpoint", "a.checkpoint")


@pytest.fixture
def here(image: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(image.parent)


@pytest.fixture
def struck(monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGTERM comes in the sixth step."""
    advance, steps = Step.advance, []

    def strike(step: Step) -> None:
        steps.append(step)
        if len(steps) == 6:
            os.kill(os.getpid(), signal.SIGTERM)
        advance(step)

    monkeypatch.setattr(Step, "advance", strike)


@pytest.mark.usefixtures("here", "struck")
@pytest.mark.parametrize("command", ["vectorize", "refine"])
def test_sigterm_leaves_a_checkpoint_and_the_next_run_goes_on(command: str, cli: Cli) -> None:
    given: tuple[Any, ...] = ("vectorize", "photo.png", *RUN)
    if command == "refine":
        assert run("vectorize", "photo.png", "-o", "base.svg", *QUICK, "--iterations", 3) == 0
        given = ("refine", "base.svg", "photo.png", "--iterations", 12, "-q", "--checkpoint", "a.checkpoint")
    assert run(*given, "-o", "a.svg") == 143
    assert Path("a.checkpoint").exists() and Path("a.svg").exists()
    assert "a checkpoint exists; --resume continues from it" in cli(*given, "-o", "a.svg", code=2).line
    assert run(*given, "-o", "a.svg", "--resume") == 0
    assert not Path("a.checkpoint").exists()
    assert run(*given, "-o", "b.svg", "--resume") == 0
    assert Path("a.svg").read_bytes() == Path("b.svg").read_bytes()
