"""Drawings within a size."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from warpsplat.fit.settings import make_settings
from warpsplat.fit.work import Progress
from warpsplat.jobs.subjects import FEWER_ROUNDS, Tries, decided
from warpsplat.jobs.vectorize import vectorize
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray
from warpsplat.trace.trace import trace

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
    whole = vectorize(squares(), make_settings(subject="drawing"), Backend.on(device))
    assert whole.score
    assert len(whole.scene) >= len(COLORS)
    limit = round(0.75 * whole.score.bytes)
    made = vectorize(squares(), make_settings(subject="drawing", max_bytes=limit), Backend.on(device))
    assert made.score
    assert made.score.bytes <= limit and not made.missed
    assert len(COLORS) // 2 <= len(made.scene) < len(whole.scene)


def test_a_size_leaves_drawings_what_they_are() -> None:
    image = np.ones((160, 200, 3), np.float32)
    for i in range(8):
        cv2.circle(
            image, (25 + 45 * (i % 4), 40 + 80 * (i // 4)), 15 + i, (0.1 * i, 0.5, 0.9), -1, cv2.LINE_AA
        )
    settings, why = decided(image, make_settings(max_bytes="1KB"))
    assert settings.subject == "drawing" and why
    settings, why = decided(image, make_settings(target_psnr=30.0))
    assert settings.subject == "photo" and "target-psnr" in why


def test_tries_of_a_size_are_one_progress() -> None:
    """Each is expected to go on from where the one before it ended, not to begin anew."""
    traced, told = trace(squares()).scene, list[Progress]()

    def half_way(tries: Tries, shapes: int) -> float:
        report = tries.begun(traced.take(np.arange(shapes)))
        assert report
        report(Progress(1, 2, 20.0, 0.0, 0.5, fine=True))
        return told[-1].work

    assert half_way(Tries(told.append, 10**6), 8) == pytest.approx(0.5), "it fits"
    tries = Tries(told.append, 100)
    first = half_way(tries, 8)
    assert 0 < tries.left < FEWER_ROUNDS, "with 8 regions there is not much to choose"
    assert 0 < first < 0.25
    tries.left = 1.0
    second = half_way(tries, 4)
    assert second > first
    tries.left = 0.0
    assert half_way(tries, 4) > second
    assert Tries(None, 100).begun(traced) is None
