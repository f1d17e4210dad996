"""Colours that no pixel shows are found through optics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageFilter

import warpsplat
from tests.drawing.test_optics import BOX, pixels, show
from tests.drawing.trace.drawings import draw
from warpsplat.drawing.optics import SCALE, Seen
from warpsplat.drawing.seen_colors import MOST_COLORS, with_seen_colors
from warpsplat.scene import Scene
from warpsplat.svg.viewer import on_white, render_svg

INK = (61, 31, 54)
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{0}" viewBox="0 0 96 96">'
    '<rect width="96" height="96" fill="#fff"/><circle cx="30" cy="34" r="22" fill="#a23b72"/>'
    '<path d="M58 12l2-.5 20 76-2 .5zM12 70l60-8 .3 2-60 8z" fill="#3d1f36"/></svg>'
)


def sharpened() -> Image.Image:
    big = Image.fromarray(np.asarray(on_white(render_svg(SVG.format(768)))).astype(np.uint8))
    return big.resize((96, 96), BOX).filter(ImageFilter.UnsharpMask(1, 60, 0))


def scene() -> Scene:
    return warpsplat.load_svg(SVG.format(96))


@pytest.mark.parametrize("is_wrong", [True, False])
def test_the_ink_of_thin_lines_is_what_it_was(is_wrong: bool) -> None:
    seen, true = Seen.of(pixels(sharpened())), scene()
    kernel = seen.find(*(show(each) for each in seen.scenes(true))).kernel
    is_ink = (np.abs(255 * true.colors - INK) < 1).all(axis=1)
    wrong = np.where(is_ink[:, None] & is_wrong, np.float32([0.15, 0, 0.12]), true.colors)
    found = with_seen_colors(replace(true, colors=wrong), seen, kernel, show)
    np.testing.assert_allclose(255 * found.colors, 255 * true.colors, atol=4)
    np.testing.assert_array_equal(found.points, true.points)


def test_gradients_stay_and_count() -> None:
    """What is not flat shows as it is; colours beside it are solved for."""
    shaded = (
        SVG.format(96)
        .replace(
            "<circle",
            '<linearGradient id="g"><stop stop-color="#fd0"/><stop offset="1" stop-color="#06c"/>'
            "</linearGradient><circle",
            1,
        )
        .replace('fill="#a23b72"', 'fill="url(#g)"')
    )
    true = warpsplat.load_svg(shaded)
    image = pixels(Image.fromarray(np.asarray(on_white(render_svg(shaded))).astype(np.uint8)))
    seen = Seen.of(image)
    kernel = seen.find(*(show(each) for each in seen.scenes(true))).kernel
    found = with_seen_colors(true, seen, kernel, show)
    np.testing.assert_array_equal(found.stop_colors, true.stop_colors)
    np.testing.assert_allclose(255 * found.colors, 255 * true.colors, atol=4)


def test_many_colours_stay() -> None:
    bars = "".join(
        f'<path d="M{5 * i} 0h4v96h-4z" fill="rgb({15 * i},0,90)"/>' for i in range(MOST_COLORS + 1)
    )
    drawn = warpsplat.load_svg(f'<svg xmlns="http://www.w3.org/2000/svg" width="96" height="96">{bars}</svg>')
    seen = Seen.of(draw(bars))
    fine = np.zeros((SCALE * 96, SCALE * 96, 4), np.float32)
    assert with_seen_colors(drawn, seen, seen.find(fine).kernel, lambda each: fine) is drawn
