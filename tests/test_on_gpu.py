"""The command for the day when a GPU is there, tried on the CPU in small; and that a step copies nothing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from PIL import Image

from tests import ROOT, fake_cuda, needs
from tests.fit.pictures import picture, step_for
from tests.on_gpu import __main__ as on_gpu
from tests.on_gpu.parts import Plan
from tests.scenes import random_scene
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Kind

pytestmark = needs.WHOLE

QUICK = ("agreement", "bits", "streams", "memory", "quality")
"""Parts that take a second each in small. ``kernels`` compiles all, ``speed`` most of them."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    noise = np.random.default_rng(0).integers(0, 255, (32, 48, 3), np.uint8)
    for name in "abcd":
        Image.fromarray(noise).save(tmp_path / f"{name}.png")
    (tmp_path / "notes.txt").write_text("no picture")
    return tmp_path


@pytest.mark.slow
def test_the_day_with_a_gpu_is_rehearsed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the test device, with a PyTorch that knows nothing of it: what needs that is left out, no more."""
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")
    arguments = ["--small", "--pictures", str(folder), "--count", "1"]
    done = fake_cuda.run("-m", "tests.on_gpu", *arguments, "--only", *QUICK, "speed", "torch", cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    ends = re.findall(r"s  (\w+): (PASS|FAIL|LEFT OUT)", done.stdout)
    left_out = {"streams", "torch"}
    wanted = {name: "LEFT OUT" if name in left_out else "PASS" for name in (*QUICK, "speed", "torch")}
    assert dict(ends) == wanted
    assert "forward and backward, closed, 16, 64x64: " in done.stdout


def test_a_part_that_takes_too_long_is_ended() -> None:
    (row,) = on_gpu.rows_of("kernels", Plan("cpu", ()), limit=0.2)
    assert not row.passed
    assert "not done after 0.2 s" in row.figure


def test_a_step_copies_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither to the host, for which it would wait, nor to the device."""
    scene = random_scene(Kind.FILL, 12, 96, 64)
    step = step_for(scene, picture(96, 64), "cpu", make_settings(density={"interval": 0}))
    step.advance()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a copy")

    for name in ("numpy", "assign", "__init__"):
        monkeypatch.setattr(wp.array, name, refuse)
    for _ in range(3):
        step.advance()
