"""What should not matter for a drawing: margins, noise of a level or two, colours of half the resolution."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import warpsplat
from tests.drawing.drawings import vectorized
from tests.drawing.trace.drawings import LOGO, as_file, decibels, draw, draw_exactly, ground
from warpsplat.drawing.chroma import halved, has_blurred_colors, with_sharp_colors
from warpsplat.drawing.denoise import without_noise
from warpsplat.drawing.picture import Picture
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import render_svg

WHITE = '<rect width="96" height="96" fill="#fff"/>'

THIN = WHITE + "".join(
    f'<line x1="{20 + 9 * i}" y1="{18 + 2 * i}" x2="{30 + 7 * i}" y2="78" stroke="#33261d"/>'
    for i in range(6)
)
"""Lines of a pixel."""

BODIES = {"logo": WHITE + f'<g transform="translate(10 10)">{LOGO}</g>', "thin": THIN}


def image_of(name: str) -> FloatArray:
    """Return a drawing on white, 96 x 96 px."""
    return draw(BODIES[name], 96, 96)


def padded(image: FloatArray, left: int, top: int, right: int, bottom: int) -> FloatArray:
    """Return an image with a white margin."""
    return np.pad(image, ((top, bottom), (left, right), (0, 0)), constant_values=1)


def with_noise(image: FloatArray, levels: int) -> FloatArray:
    """Return an image whose values differ by up to ``levels``."""
    off = np.random.default_rng(0).integers(-levels, levels + 1, image.shape)
    return (np.clip(np.round(image * 255) + off, 0, 255) / 255).astype(np.float32)


def drawn(image: FloatArray, quality: str) -> npt.NDArray[np.uint8]:
    """Return a drawing of an image, as a viewer shows it."""
    made = warpsplat.vectorize(image, subject="drawing", quality=quality, threads=1, device="cpu")
    return np.asarray(render_svg(made.svg).convert("RGB"))


def test_images_that_reach_the_border_are_not_cropped() -> None:
    image = image_of("thin")
    image[:, 0] = np.linspace(0, 1, 96)[:, None]
    picture = Picture.of(image)
    assert np.array_equal(picture.pixels, image)
    assert not picture.corner.any()
    assert picture.share == picture.drawn_share == 1


@pytest.mark.parametrize("tint", [1, 7])
def test_a_pale_line_to_the_border_is_not_cut_off(tint: int) -> None:
    image = padded(image_of("thin"), 0, 60, 0, 0)
    image[20] = 1 - tint / 255
    assert np.array_equal(Picture.of(image).pixels, image)


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_a_margin_changes_nothing(name: str, quality: str) -> None:
    """The same shapes, moved; only how the file rounds them may depend on the size of its view box."""
    image = image_of(name)
    plain, wide = drawn(image, quality), drawn(padded(image, 60, 17, 5, 90), quality)
    assert decibels(wide[17 : 17 + 96, 60 : 60 + 96] / 255, plain / 255) > 45, "48 at least, mostly equal"
    assert (wide[:17] == 255).all() and (wide[17 + 96 :] == 255).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_noise_of_a_level_costs_little(name: str, quality: str) -> None:
    """Up to 9 dB before flat colours were freed of it; 2 of a logo that has 52."""
    image = image_of(name)
    losses = [decibels(drawn(each, quality) / 255, image) for each in (image, with_noise(image, 1))]
    assert losses[1] > losses[0] - 3


def test_an_image_without_noise_and_a_gradient_stay_as_they_are() -> None:
    ramp = np.repeat(np.linspace(0, 1, 96, dtype=np.float32)[None, :, None], 3, axis=2).repeat(96, axis=0)
    for image, known in ((image_of("logo"), 0.0), (with_noise(ramp, 2), None)):
        clean, noise = without_noise(image)
        assert clean is image
        assert noise == known


SHAPES = (
    ground("#ffd24a", 96, 96)
    + '<path d="M48.3 8.4C71 14 82 33 86.2 70.7L60.6 62.3Q48 91 30.7 88.2L9.6 30.4Z" fill="#c01850"/>'
)

LINES = ground("#fff", 96, 96) + "".join(
    f'<path d="M{8 + 16 * i} 6l1.4-.2 6 80-1.4.2z" fill="{color}"/>'
    for i, color in enumerate(["#d01020", "#1030c0", "#108040", "#d01020", "#1030c0"])
)
"""Thin lines in strong colours."""


@pytest.fixture(scope="module")
def image() -> FloatArray:
    return draw_exactly(SHAPES, 96, 96)


@pytest.fixture(scope="module")
def lines() -> FloatArray:
    return draw_exactly(LINES, 96, 96)


def test_colours_are_blurred_by_subsampling_only(image: FloatArray) -> None:
    grey, clear = np.repeat(image[..., :1], 3, axis=2), image[..., :1] * 0 + np.float32(0.5)
    halved_one, whole, halved_grey = (
        as_file(each, quality=75, subsampling=how) for each, how in ((image, 2), (image, 0), (grey, 2))
    )
    assert has_blurred_colors(halved_one)
    for other in (image, whole, halved_grey, np.concatenate([halved_one, clear], axis=2)):
        assert not has_blurred_colors(other)


@pytest.mark.parametrize("kind", ["jpeg", "webp"])
def test_halved_matches_chroma_subsampling_of_files(lines: FloatArray, kind: str) -> None:
    levels = np.round(255 * lines)
    file = np.round(255 * as_file(lines, kind, quality=100))
    assert decibels(halved(levels) / 255, file / 255) > decibels(levels / 255, file / 255) + 6


def test_colours_become_as_sharp_as_lightness(image: FloatArray, lines: FloatArray) -> None:
    for each in (image, lines):
        soft = as_file(each, quality=95, subsampling=2)
        assert decibels(with_sharp_colors(soft), each) > decibels(soft, each) + 3


def test_thin_lines_keep_their_colours(lines: FloatArray, device: str) -> None:
    """Colours taken as the file has them come to 28 dB."""
    made = vectorized(as_file(lines, quality=95, subsampling=2), device)
    large = draw_exactly(f'<g transform="scale(4)">{LINES}</g>', 384, 384)
    assert decibels(render(made.scene, scale=4), large) > 38
