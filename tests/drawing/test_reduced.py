"""Images that were enlarged by linear interpolation are found, and what they were before."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image, ImageFilter

import warpsplat
from tests.drawing.test_optics import BOX, SIDE, enlarged, pixels, psnr, small
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.reduced import before_enlarging
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import on_white, render_svg


def levels(image: Image.Image) -> FloatArray:
    return np.asarray(image, np.float32)


@pytest.mark.parametrize("size", [(120, 120), (144, 144), (201, 200), (230, 230), (301, 300)])
def test_any_factor_is_found(size: tuple[int, int]) -> None:
    was = small(BOX)
    found = before_enlarging(levels(was.resize(size, Image.Resampling.BILINEAR)))
    assert found is not None and found.shape == (SIDE, SIDE, 3)
    assert np.abs(found - levels(was)).mean() < 0.5


def test_opencv_enlarges_alike() -> None:
    was = np.asarray(small(BOX))
    found = before_enlarging(
        np.asarray(cv2.resize(was, (150, 150), interpolation=cv2.INTER_LINEAR), np.float32)
    )
    assert found is not None and np.abs(found - was).mean() < 0.5


@pytest.mark.parametrize(
    "how", [Image.Resampling.BICUBIC, Image.Resampling.LANCZOS, Image.Resampling.NEAREST]
)
def test_other_ways_to_enlarge_leave_an_image_as_it_is(how: Image.Resampling) -> None:
    assert before_enlarging(levels(small(BOX).resize((150, 150), how))) is None


def test_an_image_that_was_not_enlarged_stays() -> None:
    assert before_enlarging(levels(small(BOX))) is None
    assert before_enlarging(levels(enlarged(2))) is None


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
    assert psnr(shown, pixels(enlarged(4))) > 38
    assert len(made.svg) < 800
    assert made.optics and made.optics.psnr > made.score.psnr  # type: ignore[union-attr]


def test_without_optics_an_enlarged_image_is_drawn_as_it_is() -> None:
    picture = pixels(small(BOX).resize((151, 150), Image.Resampling.BILINEAR))
    assert (Picture.of(picture, is_soft=True).enlargement == 1).all()
    made = warpsplat.vectorize(picture, subject="drawing", optics="none", quality="draft")
    assert made.optics is None


def test_edges_along_the_axes_are_no_sign_of_enlargement() -> None:
    """A mixed pixel between flat ones lies alone between two of nearly any smaller image."""
    image = np.full((90, 120, 3), 250, np.float32)
    image[20:70, 30:80] = (40, 90, 160)
    image[20:70, 29], image[20:70, 80], image[19, 30:80], image[70, 30:80] = 180, 100, 230, 130
    assert before_enlarging(image) is None


def test_what_is_smooth_was_of_any_size() -> None:
    soft = small(BOX).filter(ImageFilter.GaussianBlur(2.5))
    assert before_enlarging(levels(soft)) is None
