"""Images that were enlarged by linear interpolation are found, and what they were before."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image, ImageFilter

import warpsplat
from tests.drawing.test_optics import BOX, SIDE, enlarged, pixels, small
from tests.drawing.trace.drawings import decibels
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.reduced import before_enlarging
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import on_white, render_svg


def levels(image: Image.Image) -> FloatArray:
    return np.asarray(image, np.float32)


@pytest.mark.parametrize("size", [(120, 120), (144, 144), (201, 200), (230, 230), (301, 300)])
@pytest.mark.parametrize("by", ["Pillow", "OpenCV"])
def test_any_factor_is_found(size: tuple[int, int], by: str) -> None:
    was = small(BOX)
    large = was.resize(size, Image.Resampling.BILINEAR)
    if by == "OpenCV":
        large = Image.fromarray(cv2.resize(np.asarray(was), size, interpolation=cv2.INTER_LINEAR))
    found = before_enlarging(levels(large))
    assert found is not None and found.shape == (SIDE, SIDE, 3)
    assert np.abs(found - levels(was)).mean() < 0.5


@pytest.mark.parametrize(
    "how", [Image.Resampling.BICUBIC, Image.Resampling.LANCZOS, Image.Resampling.NEAREST]
)
def test_other_ways_to_enlarge_leave_an_image_as_it_is(how: Image.Resampling) -> None:
    assert before_enlarging(levels(small(BOX).resize((150, 150), how))) is None


def test_what_was_not_enlarged_or_is_smooth_stays() -> None:
    for image in (small(BOX), enlarged(2), small(BOX).filter(ImageFilter.GaussianBlur(2.5))):
        assert before_enlarging(levels(image)) is None


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 2), (3, 50)])
def test_small_and_flat_images_stay(shape: tuple[int, int]) -> None:
    image = np.full((*shape, 3), 90, np.float32)
    found = before_enlarging(image)
    assert found is None or (found == 90).all()


def test_a_drawing_is_as_large_as_the_image_and_as_sharp_as_before() -> None:
    picture = pixels(small(BOX).resize((151, 150), Image.Resampling.BILINEAR))
    assert Picture.of(picture).pixels.shape[0] < 120
    made = warpsplat.vectorize(picture, subject="drawing")
    assert (made.scene.canvas.width, made.scene.canvas.height) == (151, 150)
    shown = (
        np.asarray(on_white(render_svg(made.svg, zoom=4).resize((4 * SIDE, 4 * SIDE), BOX)), np.float32) / 255
    )
    assert decibels(shown, pixels(enlarged(4))) > 38
    assert len(made.svg) < 800
    assert made.optics and made.optics.psnr > made.score.psnr  # type: ignore[union-attr]


def test_edges_along_the_axes_are_no_sign_of_enlargement() -> None:
    """A mixed pixel between flat ones lies alone between two of nearly any smaller image."""
    image = np.full((90, 120, 3), 250, np.float32)
    image[20:70, 30:80] = (40, 90, 160)
    image[20:70, 29], image[20:70, 80], image[19, 30:80], image[70, 30:80] = 180, 100, 230, 130
    assert before_enlarging(image) is None
