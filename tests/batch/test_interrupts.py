"""Signals to a batch, or to the process group of it: each worker saves its best."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests import make_image
from tests.cli.helpers import MANIFEST
from warpsplat.svg.viewer import render_svg

pytestmark = pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "number", "to_all", "times"),
    [
        ("spawn", signal.SIGINT, True, 1),
        ("forkserver", signal.SIGTERM, True, 1),
        ("forkserver", signal.SIGTERM, False, 1),
        ("spawn", signal.SIGINT, True, 2),
    ],
)
def test_each_worker_saves_its_best(
    tmp_path: Path, method: str, number: signal.Signals, to_all: bool, times: int
) -> None:
    """The parent alone handles signals. A second one ends all at once, with whole files or none."""
    for name in ("a.png", "b.png"):
        make_image(tmp_path / name)
    options = ["--workers", "2", "--curves", "4", "--iterations", "900000", "--device", "cpu", "--json"]
    command = [sys.executable, "-m", "tests.batch.in_group", method, "batch", str(tmp_path), *options]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True)
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
