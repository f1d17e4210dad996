"""Drawings within a size."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from tests.runs import scored, vectorize
from warpsplat.drawing.draw import DEARER, TRIES, within
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.problem import Fit
from warpsplat.fit.settings import make_settings
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
def test_a_drawing_has_as_many_regions_as_fit(device: str) -> None:
    """Squares have no node to spare: some of them have to go."""
    whole = vectorize(squares(), make_settings(subject="drawing"), Backend.on(device))
    assert len(whole.scene) >= len(COLORS)
    limit = round(0.75 * scored(whole).bytes)
    made = vectorize(squares(), make_settings(subject="drawing", max_bytes=limit), Backend.on(device))
    assert scored(made).bytes <= limit and not made.missed
    assert len(COLORS) // 2 <= len(made.scene) < len(whole.scene)


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


@pytest.mark.slow
def test_outlines_get_simpler_before_regions_go(device: str) -> None:
    whole = vectorize(wavy(), make_settings(subject="drawing"), Backend.on(device))
    assert len(whole.scene) == 2
    limit = round(0.75 * scored(whole).bytes)
    made = vectorize(wavy(), make_settings(subject="drawing", max_bytes=limit), Backend.on(device))
    assert scored(made).bytes <= limit and not made.missed
    assert len(made.scene) == 2
    assert scored(made).nodes < scored(whole).nodes
    assert scored(made).psnr > 25, "without one of the discs it is 12"


def of_size(size: float) -> Fit:
    """A drawing of so many bytes, as far as the search is concerned."""
    return Fit(trace(squares()).scene, size, math.nan, math.nan, 0, False)


def within_600(size: Callable[[float], float]) -> tuple[float, list[float]]:
    """Return the size of the drawing within 600 bytes, and the prices that were tried."""
    asked: list[float] = []

    def draw(price: float) -> Fit:
        asked.append(price)
        return of_size(size(price))

    made = within(600, of_size(1000), draw, lambda made: round(made.per_pixel), 1.0, lambda: False)
    return made.per_pixel, asked


def test_the_least_price_is_taken_at_which_a_drawing_fits() -> None:
    size, asked = within_600(lambda price: 1000 - 150 * np.log2(price))
    assert asked[:3] == [8.0, 8.0**0.5, 8.0**0.75]
    assert 590 < size <= 600
    assert len(asked) <= TRIES


def test_where_nothing_fits_the_dearest_is_taken() -> None:
    size, asked = within_600(lambda price: 900 - price / DEARER**TRIES)
    assert size == 899
    assert asked == [DEARER ** (1 + k) for k in range(TRIES)]


def test_a_size_leaves_drawings_what_they_are() -> None:
    image = np.ones((160, 200, 3), np.float32)
    for i in range(8):
        cv2.circle(
            image, (25 + 45 * (i % 4), 40 + 80 * (i // 4)), 15 + i, (0.1 * i, 0.5, 0.9), -1, cv2.LINE_AA
        )
    settings, why, _ = choose_subject(image, make_settings(max_bytes="1KB"))
    assert settings.subject == "drawing" and why
    settings, why, _ = choose_subject(image, make_settings(target_psnr=30.0))
    assert settings.subject == "photo" and "target-psnr" in why
