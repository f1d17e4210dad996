"""What blurred or sharpened a picture is found and undone."""

from __future__ import annotations

import numpy as np
import pytest

import warpsplat
from tests.drawing.trace.drawings import draw
from warpsplat import metrics
from warpsplat.drawing.optics import RINGS, Optics, find_optics, without_optics
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import on_white, render_svg

BODY = (
    '<rect width="96" height="96" fill="#fff"/><path d="M12 80L44 14L82 78z" fill="#c8102e"/>'
    '<circle cx="60" cy="30" r="17" fill="#003da5"/><path d="M20 20L70 86" stroke="#222" stroke-width="4"/>'
)

GAUSS = Optics((0.38, 0.11, 0.035, 0.005, 0.003, -0.001))


def levels(image: FloatArray) -> FloatArray:
    return np.round(image * np.float32(255))


def psnr(a: FloatArray, b: FloatArray) -> float:
    return metrics.psnr(255 * a, 255 * b)


def drawn(image: FloatArray, **given: str) -> FloatArray:
    svg = warpsplat.vectorize(image, subject="drawing", **given).svg
    return np.asarray(np.asarray(on_white(render_svg(svg))) / 255, np.float32)


def blurred(image: FloatArray, optics: Optics = GAUSS) -> FloatArray:
    return (np.clip(np.round(optics(levels(image))), 0, 255) / 255).astype(np.float32)


def test_the_places_of_the_rings_are_all_of_the_square() -> None:
    places = sorted(place for ring in RINGS for place in ring)
    assert places == [(y, x) for y in range(-2, 3) for x in range(-2, 3)]


@pytest.mark.parametrize("weights", [GAUSS.weights, (1.4, -0.08, -0.02, 0.0, 0.0, 0.0)])
def test_a_kernel_is_found(weights: tuple[float, ...]) -> None:
    beside = sum(len(ring) * weight for ring, weight in zip(RINGS[1:], weights[1:], strict=True))
    true = Optics((1 - beside, *weights[1:]))
    image = np.round(levels(draw(BODY)[..., :3]) / 2 + 60)  # nothing is clipped
    found = find_optics(image / 255, np.round(true(image)) / 255)
    np.testing.assert_allclose(found.optics.weights, true.weights, atol=0.003)
    assert found.error < 0.01 * found.without


def test_an_image_without_edges_tells_nothing() -> None:
    flat = np.full((20, 30, 3), 0.3, np.float32)
    found = find_optics(flat, flat)
    assert found.optics.weights == (1.0, 0, 0, 0, 0, 0) and found.error == found.without == 0


def test_an_image_that_is_as_it_was_drawn_stays() -> None:
    image = draw(BODY)
    pixels, trace = without_optics(image, lambda pixels: pixels, lambda trace: trace, lambda: False)
    assert pixels is image and trace is image


def test_without_time_nothing_is_looked_for() -> None:
    image = blurred(draw(BODY))
    pixels, _ = without_optics(image, lambda pixels: draw(BODY), lambda trace: trace, lambda: True)
    assert pixels is image


def test_a_blurred_picture_is_as_it_was_where_its_trace_is_right() -> None:
    image = draw(BODY)
    pixels, _ = without_optics(blurred(image), lambda pixels: image, lambda trace: trace, lambda: False)
    assert psnr(pixels, image) > 45


def test_colours_stay_below_opacity() -> None:
    image = np.concatenate([draw(BODY) * 0.5, np.full((96, 96, 1), 0.5, np.float32)], axis=2)
    pixels, _ = without_optics(blurred(image), lambda pixels: image, lambda trace: trace, lambda: False)
    assert (pixels[..., :3] <= pixels[..., 3:]).all()


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_a_blurred_drawing_is_drawn_sharp(quality: str) -> None:
    """It is nearer to the drawing than the picture is, and of few nodes."""
    image = draw(BODY)
    made = warpsplat.vectorize(blurred(image), subject="drawing", quality=quality)
    shown = np.asarray(on_white(render_svg(made.svg)), np.float32) / 255
    assert psnr(shown, image) > psnr(blurred(image), image) + 4
    assert len(made.svg) < 1500


def test_a_fit_through_optics_is_like_the_picture_through_them() -> None:
    image = draw(BODY)
    shown = drawn(blurred(image))
    assert psnr(blurred(shown), blurred(image)) > 40
    assert psnr(shown, image) > 33


def test_optics_may_be_left_as_they_are() -> None:
    image = draw(BODY)
    seen = blurred(image)
    sharp, soft = drawn(seen), drawn(seen, optics="none")
    assert psnr(soft, seen) > psnr(sharp, seen)
    assert psnr(soft, image) < psnr(sharp, image) - 3
