"""Drawings whose colours have half the resolution of their lightness."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from tests.drawing.trace.drawings import draw_exactly, ground
from tests.runs import vectorize
from warpsplat.drawing import chroma
from warpsplat.drawing.denoise import has_blurred_colors
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray

SHAPES = (
    ground("#ffd24a", 96, 96)
    + '<path d="M48.3 8.4C71 14 82 33 86.2 70.7L60.6 62.3Q48 91 30.7 88.2L9.6 30.4Z" fill="#c01850"/>'
)


def as_jpeg(image: FloatArray, subsampling: int) -> FloatArray:
    """Return an image as a JPEG shows it."""
    file = io.BytesIO()
    Image.fromarray(np.round(image * 255).astype(np.uint8)).save(
        file, "jpeg", quality=75, subsampling=subsampling
    )
    return np.asarray(Image.open(file), np.float32) / np.float32(255)


@pytest.fixture(scope="module")
def image() -> FloatArray:
    return draw_exactly(SHAPES, 96, 96)


def test_colours_are_blurred_by_subsampling_only(image: FloatArray) -> None:
    grey = np.repeat(image[..., :1], 3, axis=2)
    assert has_blurred_colors(as_jpeg(image, 2))
    assert not has_blurred_colors(image)
    assert not has_blurred_colors(as_jpeg(image, 0))
    assert not has_blurred_colors(as_jpeg(grey, 2))
    assert not has_blurred_colors(np.concatenate([as_jpeg(image, 2), image[..., :1] * 0 + 1], axis=2))


def test_outlines_follow_the_lightness(
    image: FloatArray, device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    large = draw_exactly(f'<g transform="scale(4)">{SHAPES}</g>', 384, 384)

    def error() -> float:
        made = vectorize(as_jpeg(image, 2), make_settings(subject="drawing"), Backend.on(device))
        return float(((render(made.scene, scale=4) - large) ** 2).mean())

    by_lightness = error()
    monkeypatch.setattr(chroma, "CHROMA_WEIGHT", 1.0)
    assert by_lightness < min(2.5e-5, 0.5 * error())
