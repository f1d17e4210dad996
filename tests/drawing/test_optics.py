"""How a picture was made is found and undone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image, ImageFilter

import warpsplat
from tests.drawing.trace.drawings import decibels, draw
from warpsplat.drawing.constraints import DRAFT_GRID
from warpsplat.drawing.edges import LINEAR, MIDDLES, find_edges
from warpsplat.drawing.optics import NONE, SCALE, Seen
from warpsplat.drawing.trace.trace import Traced, trace
from warpsplat.drawing.without_optics import without_optics
from warpsplat.fit.export import finished, shown_image
from warpsplat.fit.settings import make_settings
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.viewer import on_white, render_svg

SIDE, BIG = 96, 8

BODY = (
    '<rect width="96" height="96" fill="#f4f1de"/><path d="M12 80L44 14L82 78z" fill="#b0344d"/>'
    '<circle cx="60" cy="30" r="17" fill="#3d5a80"/><path d="M20 20L70 86" stroke="#222" stroke-width="4"/>'
)
"""Colours from which rings go beyond."""


def enlarged(times: int) -> Image.Image:
    image = draw(f'<g transform="scale({times})">{BODY}</g>', times * SIDE, times * SIDE, hard=times == BIG)
    return Image.fromarray(np.round(255 * image).astype(np.uint8))


def small(how: Image.Resampling, times: int = 1) -> Image.Image:
    return enlarged(BIG).resize((times * SIDE, times * SIDE), how)


def light(times: int = 1) -> FloatArray:
    """The drawing in linear light [levels]."""
    step = BIG // times
    parts = LINEAR[np.asarray(enlarged(BIG))].reshape(times * SIDE, step, times * SIDE, step, 3)
    return np.asarray(parts.mean(axis=(1, 3)), np.float32)


def in_linear_light() -> Image.Image:
    return Image.fromarray(np.searchsorted(MIDDLES, light()).astype(np.uint8))


BOX = Image.Resampling.BOX

MADE: dict[str, Callable[[], Image.Image]] = {
    "blurred": lambda: small(BOX).filter(ImageFilter.GaussianBlur(0.7)),
    "sharpened": lambda: small(BOX).filter(ImageFilter.UnsharpMask(1, 80, 0)),
    "by Lanczos": lambda: small(Image.Resampling.LANCZOS),
    "by bicubic": lambda: small(Image.Resampling.BICUBIC),
    "in linear light": in_linear_light,
}


def pixels(image: Image.Image) -> FloatArray:
    return np.asarray(image, np.float32) / np.float32(255)


def drawn(image: FloatArray, times: int = 1, **given: str) -> FloatArray:
    """A drawing of an image as a viewer shows it."""
    svg = warpsplat.vectorize(image, subject="drawing", **given).svg
    return np.asarray(np.asarray(on_white(render_svg(svg, zoom=times))) / 255, np.float32)


def show(scene: Scene) -> FloatArray:
    return shown_image(finished(scene, make_settings(), DRAFT_GRID / SCALE), scene, 3)


def untouched(image: FloatArray, over: Callable[[], bool] = lambda: False) -> tuple[FloatArray, int]:
    """An image without its optics, and how often it was traced."""
    times = 0

    def traced(each: FloatArray) -> Traced:
        nonlocal times
        times += 1
        return trace(each)

    result, _ = without_optics(image, None, traced, show, over)
    return result, times


@pytest.mark.parametrize("how", MADE)
def test_a_sharp_image_tells_how_a_picture_was_made(how: str) -> None:
    """Through the optics it is the picture, which without them is what means of pixels would be."""
    picture, fine = pixels(MADE[how]()), pixels(small(BOX, SCALE))
    seen = Seen.of(picture)
    found = seen.find(fine, light(SCALE) / np.float32(255) if seen.edges.is_linear else None)
    plain = pixels(small(BOX))
    assert seen.edges.is_linear == (how == "in linear light")
    assert decibels(found.shown, picture) > decibels(plain, picture) + 8
    assert decibels(found.undone, plain) > decibels(picture, plain) + 8
    assert found.error < found.without / 5


@pytest.mark.parametrize("color", [(0.3, 0.3, 0.3), (1, 1, 1)])
def test_an_image_without_edges_tells_nothing(color: tuple[float, ...]) -> None:
    flat = np.full((20, 30, 3), color, np.float32)
    found = Seen.of(flat).find(np.full((40, 60, 3), color, np.float32))
    assert found.kernel == NONE and found.error == found.without == 0
    np.testing.assert_allclose(found.undone, flat, atol=0.003)


def test_means_and_steps_of_pixels_tell_nothing() -> None:
    """Any kernel that sharpens would explain steps."""
    found = Seen.of(pixels(small(BOX))).find(pixels(small(BOX, SCALE)))
    np.testing.assert_allclose(found.kernel, NONE, atol=2e-3)
    ink = np.where(np.asarray(small(BOX).convert("L")) < 128, 0, 255)
    image = np.repeat(ink[..., None], 3, axis=2).astype(np.float32) / 255
    assert Seen.of(image).find(pixels(small(BOX, SCALE))).kernel == NONE


def test_colours_stay_below_opacity() -> None:
    planes = [pixels(small(BOX, SCALE)) * 0.5, np.full((SCALE * SIDE, SCALE * SIDE, 1), 0.5, np.float32)]
    fine = np.concatenate(planes, axis=2)
    half = [pixels(MADE["blurred"]()) * 0.5, np.full((SIDE, SIDE, 1), 0.5, np.float32)]
    undone = Seen.of(np.concatenate(half, axis=2)).find(fine).undone
    assert (undone[..., :3] <= undone[..., 3:]).all()


@pytest.mark.parametrize(("how", "is_late"), [(None, False), ("blurred", True)])
def test_an_image_that_is_as_it_was_drawn_stays_and_so_do_all_without_time(
    how: str | None, is_late: bool
) -> None:
    image = pixels(MADE[how]() if how else small(BOX))
    result, times = untouched(image, lambda: is_late)
    assert result is image and times == 1


@pytest.mark.parametrize("how", MADE)
def test_a_drawing_is_what_it_was_before(how: str) -> None:
    """It is nearer to the source, four times as large, than without its optics, and as small."""
    picture, source = pixels(MADE[how]()), pixels(enlarged(4))
    sharp, soft = (drawn(picture, 4, optics=optics) for optics in ("auto", "none"))
    assert decibels(sharp, source) > decibels(soft, source) + 0.5
    assert decibels(sharp, source) > 36
    assert len(warpsplat.vectorize(picture, subject="drawing").svg) < 1200


def test_a_blurred_draft_is_drawn_sharp() -> None:
    picture, source = pixels(MADE["blurred"]()), pixels(small(BOX))
    assert decibels(drawn(picture, quality="draft"), source) > decibels(picture, source) + 4


@pytest.mark.parametrize("how", [None, *MADE])
def test_what_edges_tell(how: str | None) -> None:
    found = find_edges(np.asarray(MADE[how]() if how else small(BOX), np.float32))
    assert found.clean.sum() > 300
    if how != "by Lanczos":  # which leaves several rings, the outermost of which are faint
        assert found.has_rings == (how in ("sharpened", "by bicubic"))
    assert found.is_linear == (how == "in linear light")


def test_outlines_are_no_rings() -> None:
    """A dark outline around a paler shape is as clean as a ring, but much darker."""
    image = np.full((40, 40, 3), 250, np.float32)
    image[8:32, 8:32] = (20, 20, 90)
    image[10:30, 10:30] = (90, 120, 200)
    found = find_edges(image)
    assert not found.has_rings
    np.testing.assert_array_equal(found.plain, image)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 3), (3, 2)])
@pytest.mark.parametrize("planes", [3, 4])
def test_small_images_have_no_edges(shape: tuple[int, int], planes: int) -> None:
    image = np.zeros((*shape, planes), np.float32)
    image[-1:, -1:] = 200
    found = find_edges(image)
    np.testing.assert_array_equal(found.plain, image)
    assert not found.has_rings and not found.is_linear
