"""Changes that should not matter for a drawing: margins, noise of a level or two."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import warpsplat
from tests.drawing.trace.drawings import LOGO, draw
from warpsplat.drawing.denoise import without_noise
from warpsplat.drawing.picture import MARGIN, Picture
from warpsplat.metrics import psnr
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


@pytest.mark.parametrize("margin", [(0, 0, 0, 0), (3, 0, 0, 1), (40, 30, 5, 90), (300, 0, 0, 0)])
def test_a_picture_has_a_margin_of_one_width(margin: tuple[int, int, int, int]) -> None:
    plain, wide = Picture.of(image_of("thin")), Picture.of(padded(image_of("thin"), *margin))
    assert np.array_equal(wide.pixels, plain.pixels)
    assert (wide.corner == plain.corner + margin[:2]).all()
    assert (wide.original_size == plain.original_size + margin[:2] + margin[2:]).all()
    assert wide.drawn_share == plain.drawn_share


def test_what_reaches_the_border_stays_as_it_is() -> None:
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


def test_a_transparent_ground_is_a_ground() -> None:
    image = np.zeros((64, 80, 4), np.float32)
    image[20:30, 40:60] = 1
    assert Picture.of(image).pixels.shape == (10 + 2 * MARGIN, 20 + 2 * MARGIN, 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_a_margin_changes_nothing(name: str, quality: str) -> None:
    """The same shapes, moved; only how the file rounds them may depend on the size of its view box."""
    image = image_of(name)
    plain, wide = drawn(image, quality), drawn(padded(image, 60, 17, 5, 90), quality)
    assert psnr(wide[17 : 17 + 96, 60 : 60 + 96] / 255, plain / 255) > 50
    assert (wide[:17] == 255).all()
    assert (wide[17 + 96 :] == 255).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_noise_of_a_level_costs_little(name: str, quality: str) -> None:
    """Up to 9 dB before flat colours were freed of it; 2 of a logo that has 52."""
    image = image_of(name)
    losses = [psnr(drawn(each, quality) / 255, image) for each in (image, with_noise(image, 1))]
    assert losses[1] > losses[0] - 3


def test_an_image_without_noise_and_a_gradient_stay_as_they_are() -> None:
    ramp = np.repeat(np.linspace(0, 1, 96, dtype=np.float32)[None, :, None], 3, axis=2).repeat(96, axis=0)
    for image, known in ((image_of("logo"), 0.0), (with_noise(ramp, 2), None)):
        clean, noise = without_noise(image)
        assert clean is image
        assert noise == known
