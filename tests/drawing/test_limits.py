"""Drawings within bytes, time, few rows and few pixels; drafts; and from few big shapes to every speck."""

from __future__ import annotations

import contextlib
import itertools
import logging
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests import ROOT
from tests.drawing.drawings import vectorized
from tests.drawing.trace.drawings import LOGO, draw, ground
from tests.runs import scored
from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.draft import byte_price
from warpsplat.drawing.draw import announce_fit, announce_trace
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.drawing.trace.trace import trace
from warpsplat.errors import ImageError
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import Settings, Subject, make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.run.prepare import choose_subject
from warpsplat.scene import FloatArray

COLORS = ("e00", "0a0", "00e", "ea0", "0ae", "a0e", "555", "000")


def squares() -> FloatArray:
    """Eight squares of different colours and sizes on white."""
    image = np.ones((48, 96, 3), np.float32)
    for i, color in enumerate(COLORS):
        x, y, side = 24 * (i % 4) + 3, 24 * (i // 4) + 3, 10 + i
        image[y : y + side, x : x + side] = [int(c, 16) / 15 for c in color]
    return image


@pytest.mark.slow
@pytest.mark.parametrize("is_wavy", [True, False])
def test_outlines_get_simpler_before_regions_go(is_wavy: bool, device: str) -> None:
    """Squares have no node to spare: some of them have to go."""
    image = wavy() if is_wavy else squares()
    whole = vectorized(image, device)
    limit = round(0.75 * scored(whole).bytes)
    made = vectorized(image, device, max_bytes=limit)
    assert scored(made).bytes <= limit and not made.missed
    if is_wavy:
        assert len(made.scene) == len(whole.scene) == 2
        assert scored(made).nodes < scored(whole).nodes
        assert scored(made).psnr > 25, "without one of the discs it is 12"
    else:
        assert len(COLORS) // 2 <= len(made.scene) < len(COLORS) <= len(whole.scene)


def wavy() -> FloatArray:
    """Two discs whose outlines are wavy, so that their files are mostly nodes."""
    y, x = np.mgrid[:64, :96].astype(np.float32) + 0.5
    image = np.ones((64, 96, 3), np.float32)
    for centre, color in ((26, (0.8, 0.1, 0.1)), (70, (0.1, 0.2, 0.8))):
        dx, dy = x - centre, y - 32
        edge = 18 + 1.2 * np.sin(14 * np.arctan2(dy, dx))
        cover = np.clip(edge - np.hypot(dx, dy) + 0.5, 0, 1)[..., None]
        image = image * (1 - cover) + cover * np.float32(color)
    return np.asarray(image, np.float32)


def test_a_size_limit_does_not_change_the_subject() -> None:
    image = draw(LOGO)
    settings, why, _ = choose_subject(image, make_settings(max_bytes="1KB"))
    assert settings.subject == "drawing" and why
    settings, why, _ = choose_subject(image, make_settings(target_psnr=30.0))
    assert settings.subject == "photo" and "target-psnr" in why


def test_long_runs_are_announced(caplog: pytest.LogCaptureFixture) -> None:
    image = Picture.of(np.random.default_rng(0).random((1500, 1500, 3), np.float32))
    with caplog.at_level(logging.WARNING):
        announce_fit(80, Settings())
        announce_trace(image, Settings(time_budget=9.0))
        assert not caplog.messages
        announce_fit(12_000, Settings())
        announce_trace(image, Settings())
    nodes, pixels = caplog.messages
    assert "12,000 nodes takes about 7 s" in nodes
    assert "tracing its 2.2 megapixels takes about 9 s" in pixels


@pytest.mark.parametrize("budget", [1, 12, 30, 60, 120])
def test_a_run_ends_within_its_time_budget(budget: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at the clock takes a second; few are missed."""
    clock = itertools.count()
    monkeypatch.setattr(time, "monotonic", lambda: float(next(clock)))
    image = np.round(255 * draw(LOGO)).astype(np.uint8)
    made = warpsplat.vectorize(image, subject="drawing", time_budget=budget, device="cpu", threads=1)
    assert not made.stopped
    assert made.seconds < budget + 12
    assert made.score is not None
    assert made.score.psnr > 30


def flag(width: int, height: int) -> np.ndarray:
    image = np.ones((height, width, 3), np.float32)
    image[:, width // 3 : 2 * width // 3] = (0.8, 0.1, 0.1)
    image[height // 2 :, : width // 3] = 0
    return image


LINES = np.ones((2, 60, 3), np.float32)
LINES[:, 3::14] = LINES[:, 4::14] = 0
RAMP = np.full((2, 60, 3), 0.5, np.float32)
RAMP[..., 0] = np.linspace(0, 1, 60)
NOISE = np.random.default_rng(0).random((2, 20, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("image", "subject", "least", "shapes"),
    [
        *((flag(*size), "drawing", np.inf, None) for size in ((60, 2), (2, 60), (1, 40), (2, 2))),
        *((ramp, "drawing", 40, 1) for ramp in (RAMP, RAMP[:1])),
        (NOISE, "drawing", 60, None),
        (LINES, "line", 20, None),
    ],
)
def test_few_rows_or_columns(
    image: FloatArray, subject: str, least: float, shapes: int | None, device: str
) -> None:
    """A ramp is one gradient, and what has no regions is its cells."""
    result = vectorized(image, device, subject)
    assert (result.scene.canvas.width, result.scene.canvas.height) == image.shape[1::-1]
    assert scored(result).psnr >= least
    assert shapes is None or len(result.scene) == shapes
    assert image is not NOISE or choose_subject(image, make_settings())[0].subject == "pixel"


@pytest.mark.parametrize("subject", ["auto", "drawing", "pixel", "line"])
@pytest.mark.parametrize("content", ["noise", "flat"])
def test_images_of_a_few_pixels_become_files(subject: Subject, content: str) -> None:
    """Or are refused, as line art without a line is."""
    for height, width in ((2, 2), (2, 3), (3, 2), (3, 3), (7, 2), (2, 12), (4, 5)):
        for shape in ((height, width), (height, width, 3), (height, width, 4)):
            noise = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
            image = noise if content == "noise" else np.full(shape, 77, np.uint8)
            with contextlib.suppress(*[ImageError] * (subject == "line")):
                made = warpsplat.vectorize(image, subject=subject, quality="draft")
                assert made.svg.startswith("<svg") and made.score, shape


PROGRAM = """
import sys
import warpsplat
result = warpsplat.vectorize(sys.argv[1], quality="draft", output=sys.argv[2])
print(result.subject, "warp" in sys.modules, result.score.psnr)
"""


def draft(image: np.ndarray, **options: Any) -> warpsplat.Result:
    return warpsplat.vectorize(np.round(255 * image).astype(np.uint8), quality="draft", **options)


@pytest.mark.parametrize("subject", ["drawing", "pixel"])
def test_warp_is_not_imported(tmp_path: Path, subject: str) -> None:
    """Which takes longer than tracing a logo; figures are there all the same."""
    image = draw(f'<rect width="96" height="96" fill="#fff"/>{LOGO}')
    if subject == "pixel":
        image = np.repeat(np.repeat(np.round(2 * image[4::8, 4::8]) / 2, 8, axis=0), 8, axis=1)
    Image.fromarray(np.round(255 * image[..., :3]).astype(np.uint8)).save(tmp_path / "a.png")
    command = [sys.executable, "-c", PROGRAM, "a.png", "a.svg"]
    done = subprocess.run(
        command, cwd=tmp_path, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True
    )
    found, has_warp, psnr = done.stdout.split()
    assert (found, has_warp) == (subject, "False")
    assert float(psnr) > 33
    assert (tmp_path / "a.svg").read_text().startswith("<svg")


DOTS = ground("#fff") + "".join(
    f'<circle cx="{x}" cy="{x}" r="{radius}" fill="{color}"/>'
    for x, radius, color in ((38, 30, "#2457a8"), (80, 9, "#ee4266"), (10, 4, "#187a3c"))
)
"""Three dots, each of which shows less than the one before it."""


def test_figures_few_bytes_few_colours_and_few_rows() -> None:
    whole = draft(draw(LOGO), subject="drawing")
    found = whole.as_dict()
    assert found["psnr"] > 33
    assert (found["render_psnr"], found["estimated_psnr"], found["iterations"]) == (None, None, 0)
    whole = draft(draw(DOTS), subject="drawing")
    most = scored(whole).bytes - 30
    small = draft(draw(DOTS), subject="drawing", max_bytes=most)
    assert len(whole.scene) > len(small.scene) > 1
    assert scored(small).bytes <= most
    colors = draft(draw(LOGO), subject="drawing", palette="#2457a8,#ffffff").scene.colors
    assert {tuple(each) for each in np.round(255 * colors).astype(int)} == {(36, 87, 168), (255, 255, 255)}
    assert scored(draft(flag(60, 2), subject="drawing")).psnr == np.inf


SPECKS = [(x, y) for y in (8, 40, 72) for x in (10, 34, 58, 82)]
"""Places of dust, each of 2 x 2 pixels."""


def dusty() -> FloatArray:
    """Two big shapes on white, with dust."""
    image = np.ones((96, 96, 3), np.float32)
    image[16:36, 12:84] = 0.8, 0.2, 0.1
    image[48:68, 12:84] = 0.1, 0.3, 0.7
    for x, y in SPECKS:
        image[y : y + 2, x : x + 2] -= 0.25
    return image.clip(0, 1)


def regions(detail: float) -> int:
    """How many outlines a trace of the drawing has."""
    return len(trace(dusty(), price=byte_price(make_settings(detail=detail))).scene.starts) - 1


def test_lower_detail_removes_specks_first() -> None:
    counts = [regions(detail) for detail in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert counts == sorted(counts)
    assert counts[0] == 2
    assert counts[-1] >= 2 + len(SPECKS)


def test_a_run_that_is_over_delivers_the_trace(device: str) -> None:
    traced = trace(dusty())
    run = Run(Backend.on(device), stop=lambda: True)
    finished = finish_drawing(dusty(), Drawing(traced.scene, traced.joints), run)
    assert finished.drawing.scene is traced.scene
