"""Drawings whose colours have half the resolution of their lightness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import vectorized
from tests.drawing.trace.drawings import as_file, decibels, draw_exactly, ground
from warpsplat.drawing.chroma import halved, has_blurred_colors, with_sharp_colors
from warpsplat.drawing.optics import NONE, SCALE, Seen
from warpsplat.drawing.picture import Picture
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray

SHAPES = (
    ground("#ffd24a", 96, 96)
    + '<path d="M48.3 8.4C71 14 82 33 86.2 70.7L60.6 62.3Q48 91 30.7 88.2L9.6 30.4Z" fill="#c01850"/>'
)

LINES = ground("#fff", 96, 96) + "".join(
    f'<path d="M{8 + 16 * i} 6l1.4-.2 6 80-1.4.2z" fill="{color}"/>'
    for i, color in enumerate(["#d01020", "#1030c0", "#108040", "#d01020", "#1030c0"])
)
"""Thin lines in strong colours."""


def as_jpeg(image: FloatArray, subsampling: int) -> FloatArray:
    return as_file(image, quality=75, subsampling=subsampling)


@pytest.fixture(scope="module")
def image() -> FloatArray:
    return draw_exactly(SHAPES, 96, 96)


@pytest.fixture(scope="module")
def lines() -> FloatArray:
    return draw_exactly(LINES, 96, 96)


def test_colours_are_blurred_by_subsampling_only(image: FloatArray) -> None:
    grey, clear = np.repeat(image[..., :1], 3, axis=2), image[..., :1] * 0 + np.float32(0.5)
    assert has_blurred_colors(as_jpeg(image, 2))
    assert not has_blurred_colors(image)
    assert not has_blurred_colors(as_jpeg(image, 0))
    assert not has_blurred_colors(as_jpeg(grey, 2))
    assert not has_blurred_colors(np.concatenate([as_jpeg(image, 2), clear], axis=2))


@pytest.mark.parametrize("kind", ["jpeg", "webp"])
def test_halved_is_what_files_do(lines: FloatArray, kind: str) -> None:
    levels = np.round(255 * lines)
    file = np.round(255 * as_file(lines, kind, quality=100))
    assert decibels(halved(levels) / 255, file / 255) > decibels(levels / 255, file / 255) + 6


def test_colours_become_as_sharp_as_lightness(image: FloatArray, lines: FloatArray) -> None:
    for each in (image, lines):
        soft = as_file(each, quality=95, subsampling=2)
        assert decibels(with_sharp_colors(soft), each) > decibels(soft, each) + 3


def test_a_frame_begins_where_a_square_of_pixels_does(lines: FloatArray) -> None:
    wide = np.pad(lines, [(21, 16), (19, 16), (0, 0)], mode="edge")
    picture = Picture.of(as_file(wide, quality=95, subsampling=2))
    assert picture.is_halved
    assert picture.seen is not None
    assert picture.seen.shape == picture.pixels.shape
    np.testing.assert_array_equal(picture.corner % 2, 0)


def test_what_a_drawing_lacks_is_found_through_halved_colours(image: FloatArray) -> None:
    """The picture without the optics of the true drawing is about the drawing; no kernel is looked for."""
    seen = Seen.of(as_file(image, quality=95, subsampling=2))
    assert seen.is_halved
    fine = draw_exactly(f'<g transform="scale({SCALE})">{SHAPES}</g>', SCALE * 96, SCALE * 96)
    found = replace(seen, has_kernel=False).find(fine)
    assert found.kernel == NONE
    assert decibels(found.undone, image) > decibels(seen.levels / 255, image) + 6
    assert decibels(found.shown, seen.levels / 255) > decibels(image, seen.levels / 255) + 6


def test_thin_lines_keep_their_colours(lines: FloatArray, device: str) -> None:
    """Colours taken as the file has them come to 28 dB."""
    made = vectorized(as_file(lines, quality=95, subsampling=2), device)
    large = draw_exactly(f'<g transform="scale(4)">{LINES}</g>', 384, 384)
    assert decibels(render(made.scene, scale=4), large) > 38
