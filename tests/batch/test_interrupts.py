"""Signals to the process group of a batch: its parent alone handles them, and each worker saves its best."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.batch.stub import SIGNALS
from tests.cli.helpers import MANIFEST
from warpsplat.svg.viewer import render_svg

METHODS = ("spawn", "forkserver")

pytestmark = pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")


def start(*arguments: object) -> subprocess.Popen[str]:
    """Start the script in a process group of its own."""
    command = [sys.executable, "-m", "tests.batch.in_group", *map(str, arguments)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_no_signal_reaches_a_worker(method: str) -> None:
    """Neither while it starts nor at work, whichever it is; the streams end when no process is left."""
    out, err = start(method).communicate(timeout=120)
    assert not err
    found = json.loads(out)
    assert set(found["received"]) == set(SIGNALS), "the parent gets them"
    assert len(found["figures"]) == 3
    assert len({figures["process"] for figures in found["figures"]}) <= 2, "no worker was replaced"
    for figures in found["figures"]:
        assert set(SIGNALS) <= set(figures["blocked"]), "and none ever could"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "number", "to_all", "times"),
    [
        ("spawn", signal.SIGINT, True, 1),
        ("forkserver", signal.SIGTERM, False, 1),
        ("spawn", signal.SIGINT, True, 2),
    ],
)
def test_each_worker_saves_its_best(
    tmp_path: Path, method: str, number: signal.Signals, to_all: bool, times: int
) -> None:
    """A second signal ends all at once, with whole files or none."""
    for name in ("a.png", "b.png"):
        Image.fromarray(np.random.default_rng(0).integers(0, 255, (24, 32, 3), np.uint8)).save(
            tmp_path / name
        )
    options = ("--workers", 2, "--curves", 4, "--iterations", 900_000, "--device", "cpu", "--json")
    process = start(method, "batch", tmp_path, *options)
    assert process.stderr
    begun: set[str] = set()
    while len(begun) < 2 and (line := process.stderr.readline()):
        begun |= {line} if line.startswith("under way") else set()
    for _ in range(times):
        (os.killpg if to_all else os.kill)(process.pid, number)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 128 + number, err
    assert "Traceback" not in err
    results = sorted(tmp_path.glob("*.svg"))
    for path in results:
        render_svg(path.read_text())
    left = {path.name for path in tmp_path.iterdir()} - {path.name for path in results}
    assert left == {"a.png", "b.png", MANIFEST}, "no unfinished file"
    assert not (tmp_path / MANIFEST).read_text().count('"made"'), "the next run makes them in full"
    if times == 1:
        *images, _ = map(json.loads, out.splitlines())
        assert [image["status"] for image in images] == ["stopped"] * 2
        assert all(image["iterations"] > 0 for image in images)
        assert [path.stem for path in results] == ["a", "b"]
