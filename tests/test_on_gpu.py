"""The command for the day when a GPU is there, tried on the CPU in small; and what a step is counted as."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests import ROOT, fake_cuda, needs, roofline
from tests.on_gpu import __main__ as on_gpu
from tests.on_gpu.parts import Plan
from tests.tracing.trace import Count, Memory
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import GPU_LANES

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


@pytest.mark.slow
@pytest.mark.parametrize("kind", roofline.KINDS)
def test_a_step_is_counted(kind: str) -> None:
    """The bytes of images are known, the operations nearly so."""
    counts = {count.kernel: count for count in roofline.counts_of_step(kind, 12, 96, 64)}
    pixels = 96 * 64
    forward = counts["composite_forward"]
    assert forward.threads == pixels // 256 * GPU_LANES
    assert forward.memory["image"].sectors_written == forward.memory["image"].written == 3 * 4 * pixels
    loss = counts["window_loss"]
    assert loss.memory["target"].sectors_read == 3 * 4 * pixels
    assert 3 * 7 * pixels < loss.simple < 3 * 40 * pixels
    assert counts["radix_sort_pairs"].memory[""].written % (2 * 4) == 0
    summary = roofline.Summary.of(list(counts.values()))
    assert summary.nodes > summary.launches == len(counts)
    assert "composite_backward" in roofline.kernel_table(list(counts.values()))


def test_the_roofline_is_the_larger_time() -> None:
    memory = {"a": Memory(10**9, 0, 10**9, 0)}
    count = Count("forward", "some", 1, memory, simple=10**9, slow=0, longest=0)
    assert roofline.roofline(count) == pytest.approx(1e9 / 3.35e12)
    assert roofline.limit(count) == "memory"
    count = Count("forward", "some", 1, memory, simple=10**9, slow=10**10, longest=0)
    assert roofline.roofline(count) == pytest.approx(81e9 / 33.5e12)
    assert roofline.limit(count) == "arithmetic"


def test_copies_and_the_hosts_work_are_counted(folder: Path) -> None:
    ledger = roofline.run_ledger(folder / "a.png", make_settings(curves=6, iterations=40, subject="photo"))
    assert ledger.work["densify"].count >= 1
    assert ledger.to_host["rendering.renderer.read_image"].bytes >= 48 * 32 * 3 * 4
    assert ledger.kernels > 0
    assert "densify" in "".join(roofline.run_tables(ledger))


def test_a_step_copies_nothing() -> None:
    from tests.tracing.copies import counting

    step = roofline.scene_step("closed", 12, 96, 64, lanes=1)
    with counting() as ledger:
        for _ in range(3):
            step.advance()
    assert not ledger.to_host
    assert not ledger.to_device
