"""What is done with an image for what it shows."""

from __future__ import annotations

import numpy as np
import pytest

from tests.trace.line_art import drawn
from warpsplat.fit.settings import make_settings
from warpsplat.jobs.subjects import LEAST_SIDE, enlargement
from warpsplat.jobs.vectorize import vectorize
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray

DRAWING = (
    '<circle cx="50" cy="50" r="31" fill="#06c" stroke="none"/>'
    '<path d="M4 92L40 60L90 96z" fill="#fc0" stroke="none"/>'
)


def repeated(image: FloatArray, times: int) -> FloatArray:
    return np.repeat(np.repeat(image, times, axis=0), times, axis=1)


def test_a_picture_of_repeated_pixels_is_traced_as_what_it_was(device: str) -> None:
    """The large file shows what the small one does, without the steps of the pixels."""
    small = drawn(DRAWING, 100, 100)
    settings = make_settings(subject="drawing")
    large = vectorize(repeated(small, 3), settings, Backend.on(device))
    assert {'width="300"', 'height="300"'} <= set(large.svg.partition(">")[0].split())
    assert (large.scene.canvas.width, large.scene.canvas.height) == (300, 300)
    plain = vectorize(small, settings, Backend.on(device))
    assert plain.score
    assert score_svg(large.svg, small, eyes=False).psnr > plain.score.psnr - 0.5
    assert large.scene.points.shape == plain.scene.points.shape


@pytest.mark.parametrize(
    ("side", "times", "found"),
    [(LEAST_SIDE, 2, 2), (LEAST_SIDE - 1, 2, 1), (LEAST_SIDE // 2, 6, 3), (20, 1, 1)],
)
def test_enlargement_leaves_a_picture_to_trace(side: int, times: int, found: int) -> None:
    noise = np.random.default_rng(0).random((side, side + 1, 3)).astype(np.float32)
    assert enlargement(repeated(noise, times)) == found
