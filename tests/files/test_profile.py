"""Colours by the profiles of images."""

from __future__ import annotations

import io
import logging
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageCms

from tests.files.profiles import DISPLAY_P3, SRGB, cmyk_profile, encoded, grey_profile, linear, rgb_profile
from tests.files.samples import load_image
from tests.fuzz import corpus
from warpsplat.files.profile import profile_of
from warpsplat.files.sources import image_of

COLORS = np.random.default_rng(0).integers(60, 200, (8, 9, 3)).astype(np.uint8)
"""Colours that a screen can show."""


def saved(image: Image.Image, profile: bytes, form: str = "PNG", **options: Any) -> bytes:
    return corpus.saved(image, form, icc_profile=profile, **options)


def as_srgb(colors: np.ndarray) -> np.ndarray:
    """Return Display P3 as sRGB, by its definition."""
    change = np.array(DISPLAY_P3) @ np.linalg.inv(np.array(SRGB))
    return encoded(linear(colors / 255) @ change)


@pytest.mark.parametrize("form", ["PNG", "TIFF", "WEBP"])
def test_a_screen_with_more_colours(form: str) -> None:
    options = {"lossless": True} if form == "WEBP" else {}
    data = saved(Image.fromarray(COLORS), rgb_profile(DISPLAY_P3), form, **options)
    found = load_image(data)
    assert np.abs(found - as_srgb(COLORS)).max() < 1.5 / 255
    assert np.abs(found - COLORS / 255).max() > 10 / 255, "the profile makes a difference"
    with Image.open(io.BytesIO(data)) as opened:
        np.testing.assert_array_equal(image_of(opened), found)


def test_opacity_stays() -> None:
    opacity = np.arange(72, dtype=np.uint8).reshape(8, 9, 1) + 100
    image = Image.fromarray(np.concatenate([COLORS, opacity], axis=2))
    found = load_image(saved(image, rgb_profile(DISPLAY_P3)), paper=None)
    np.testing.assert_allclose(found[..., 3:], opacity / 255, atol=1e-6)
    assert np.abs(found[..., :3] - as_srgb(COLORS) * opacity / 255).max() < 1.5 / 255


def test_profiles_of_palettes() -> None:
    image = Image.fromarray(COLORS).quantize(8)
    found = load_image(saved(image, rgb_profile(DISPLAY_P3)))
    assert np.abs(found - as_srgb(np.asarray(image.convert("RGB")))).max() < 1.5 / 255


@pytest.mark.parametrize("profile", [rgb_profile(SRGB), None])
def test_srgb_changes_no_pixel(profile: bytes | None) -> None:
    profile = profile or ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    found = load_image(saved(Image.fromarray(COLORS), profile))
    np.testing.assert_array_equal(found, COLORS / np.float32(255))


@pytest.mark.parametrize("depth", [8, 16])
def test_grey(depth: int) -> None:
    levels = np.linspace(0.2, 0.9, 40).reshape(5, 8)
    whole = np.round(levels * (2**depth - 1)).astype(np.uint8 if depth == 8 else np.uint16)
    found = load_image(saved(Image.fromarray(whole), grey_profile(1.0)))
    assert np.abs(found - encoded(levels)[..., None]).max() < 1.5 / 255
    np.testing.assert_array_equal(found[..., 0], found[..., 2])


def test_inks_of_a_printer() -> None:
    inks = np.zeros((4, 6, 4), np.uint8)
    inks[:2, :, 0] = 255
    inks[:, :2] = (0, 0, 0, 255)
    found = load_image(saved(Image.fromarray(inks, "CMYK"), cmyk_profile(), "TIFF"))
    assert found[3, 5].min() > 0.98, "paper"
    assert found[0, 0].max() < 0.02, "black"
    red, green, blue = found[0, 5]
    assert red > 0.4, "what the profile calls cyan"
    assert max(green, blue) < 0.25


@pytest.mark.parametrize(
    ("profile", "words"),
    [(b"no profile", ""), (rgb_profile(DISPLAY_P3)[:300], ""), (grey_profile(2.0), "it is of GRAY colours")],
)
def test_invalid_profiles_are_ignored_with_one_line(
    profile: bytes, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        found = load_image(saved(Image.fromarray(COLORS), profile), "photo.png")
    np.testing.assert_array_equal(found, COLORS / np.float32(255))
    (message,) = caplog.messages
    assert message.startswith(f"photo.png: its colour profile is ignored: {words}")
    assert "\n" not in message


def test_no_profile() -> None:
    assert profile_of(Image.fromarray(COLORS)) is None
