"""Drawings within a size."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from tests.drawing.drawings import vectorized
from tests.drawing.trace.drawings import LOGO, draw
from tests.runs import scored
from tests.scenes import disc
from warpsplat.drawing.draw import DEARER, TRIES, within
from warpsplat.fit.problem import Fit
from warpsplat.fit.settings import make_settings
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


def within_600(size: Callable[[float], float]) -> tuple[float, list[float]]:
    """Return the size of the drawing within 600 bytes, and the prices that were tried."""
    asked: list[float] = []
    scene = disc(9, 40, 20)

    def draw(price: float) -> Fit:
        asked.append(price)
        return Fit(scene, size(price), math.nan, math.nan, 0, False)

    usual = Fit(scene, 1000, math.nan, math.nan, 0, False)
    made = within(600, usual, draw, lambda made: round(made.per_pixel), 1.0, lambda: False)
    return made.per_pixel, asked


def test_the_least_price_is_taken_at_which_a_drawing_fits() -> None:
    size, asked = within_600(lambda price: 1000 - 150 * np.log2(price))
    assert 590 < size <= 600
    assert len(asked) <= TRIES
    size, asked = within_600(lambda price: 900 - price / DEARER**TRIES)
    assert size == 899, "the dearest one, as nothing fits"
    assert len(asked) == TRIES


def test_a_size_leaves_drawings_what_they_are() -> None:
    image = draw(LOGO)
    settings, why, _ = choose_subject(image, make_settings(max_bytes="1KB"))
    assert settings.subject == "drawing" and why
    settings, why, _ = choose_subject(image, make_settings(target_psnr=30.0))
    assert settings.subject == "photo" and "target-psnr" in why
