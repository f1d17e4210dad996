"""Commands that optimise: progress, goals, threads, Ctrl-C."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cli.helpers import QUICK, one_line, run
from tests.runs import vectorize
from warpsplat.cli.run import Bar
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import make_settings
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


def test_missed_goals_are_said_and_the_file_is_written(
    image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "a.svg"
    assert run("vectorize", image, "-o", output, *QUICK, "--target-psnr", "90") == 6
    captured = capsys.readouterr()
    assert "a.svg: " in captured.out
    assert "goal missed: target-psnr 90 dB" in one_line(captured.err)
    render_svg(output.read_text())


def test_the_number_of_threads_changes_nothing(image: Path, tmp_path: Path) -> None:
    made = []
    for threads in (1, 3):
        output = tmp_path / f"{threads}.svg"
        assert run("vectorize", image, "-o", output, *QUICK, "--iterations", 60, "--threads", threads) == 0
        made.append(output.read_bytes())
    assert made[0] == made[1]


def test_many_threads_are_bounded(image: Path) -> None:
    assert run("vectorize", image, "-o", image.parent / "a.svg", "--threads", 10**6, *QUICK) == 0
    assert threading.active_count() <= 1 + 2 * THREADS_PER_CORE * available_cores()


def test_the_bar_weighs_steps_and_shows_no_decibels_that_fall() -> None:
    """Coarse steps are cheap and their decibels are a reduced image's."""
    settings = make_settings(curves=6, iterations=100, coarse=0.5, coarse_pixels=600, density={"interval": 0})
    seen: list[Progress] = []
    target = np.full((40, 60, 3), 0.5, np.float32)
    vectorize(target, settings, Backend.on("cpu", 1), report=seen.append)
    assert [p.fine for p in seen] == [False] * 5 + [True] * 5
    work = [p.work for p in seen]
    coarse, fine = np.diff(work[:5]), np.diff(work[5:])
    # Four times the pixels.
    assert fine / coarse.mean() == pytest.approx(2, rel=0.1) and work[-1] == 1
    bar = Bar()
    texts = [bar.update(progress, 30.0 + 100 * progress.work) for progress in seen]
    assert texts[0] == "reduced image"
    for text, progress in zip(texts[1:], seen[1:], strict=True):
        seconds = round(100 * (1 - progress.work))
        assert text.startswith(f"{seconds // 60}:{seconds % 60:02} left, ")
        assert ("dB" in text) is progress.fine
    last = seen[-1]
    best = max(progress.psnr for progress in seen if progress.fine)
    texts = [bar.update(replace(last, psnr=best + change), 200.0) for change in (5, 4)]
    assert texts == [f"0:00 left, {best + 5:.2f} dB"] * 2, "decibels never fall"


@pytest.mark.slow
def test_compiling_is_said_on_a_terminal_or_with_v(image: Path, tmp_path: Path) -> None:
    options = ("vectorize", image, "-o", image.parent / "a.svg", *QUICK, "--iterations", 1)
    code = "from warp._src.context import Module; Module._compile = lambda *_, **__: exit(9)\n"
    code += f"from warpsplat.cli.main import main; main({[str(o) for o in options]!r} + ARGS)"
    for arguments, said in (([], False), (["-v"], True)):
        done = subprocess.run(
            [sys.executable, "-c", code.replace("ARGS", repr(arguments))],
            env=os.environ | {"WARP_CACHE_PATH": str(tmp_path / "cache")},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 9
        assert ("compiling kernels" in done.stderr) is said
