"""Colour profiles and resolutions of image files."""

from __future__ import annotations

import io
import logging
import zlib
from typing import Any

import numpy as np
import pytest
from PIL import ExifTags, Image, ImageCms

from tests.files.profiles import DISPLAY_P3, SRGB, cmyk_profile, encoded, grey_profile, linear, rgb_profile
from tests.files.samples import load_image
from tests.fuzz import corpus
from warpsplat.files.image import image_facts
from warpsplat.files.resolution import resolution_of
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


def stated(form: str, **saved: Any) -> tuple[float, float] | None:
    out = io.BytesIO()
    Image.new("RGB", (40, 30)).save(out, form, **saved)
    facts = image_facts(out.getvalue())
    assert facts
    assert facts.resolution == resolution_of(Image.open(io.BytesIO(out.getvalue())))
    return facts.resolution


def exif(x: float, y: float, unit: int | None = 2, orientation: int = 1) -> Image.Exif:
    made = Image.Exif()
    made[ExifTags.Base.XResolution], made[ExifTags.Base.YResolution] = x, y
    made[ExifTags.Base.Orientation] = orientation
    if unit is not None:
        made[ExifTags.Base.ResolutionUnit] = unit
    return made


@pytest.mark.parametrize("form", ["PNG", "JPEG", "TIFF", "BMP"])
def test_formats_state_it(form: str) -> None:
    assert stated(form, dpi=(300, 150)) == pytest.approx((300, 150), rel=1e-3)


@pytest.mark.parametrize("form", ["PNG", "JPEG", "WEBP", "AVIF"])
def test_exif_states_it(form: str) -> None:
    assert stated(form, exif=exif(254, 127)) == (254, 127)
    assert stated(form, exif=exif(100, 100, unit=3)) == (254, 254)
    assert stated(form, exif=exif(300, 300, unit=None)) == (300, 300)


@pytest.mark.parametrize("form", ["JPEG", "WEBP"])
def test_sides_are_those_of_the_upright_image(form: str) -> None:
    assert stated(form, exif=exif(254, 127, orientation=6)) == (127, 254)
    assert stated(form, exif=exif(254, 127, orientation=3)) == (254, 127)


def test_files_without_a_resolution() -> None:
    assert stated("PNG") is None
    assert stated("GIF") is None
    assert stated("JPEG", exif=exif(72, 72)) is None, "what EXIF prescribes where none is known"
    assert stated("JPEG", exif=exif(3, 2, unit=1)) is None, "a proportion"
    assert stated("PNG", dpi=(1, 1)) is None
    assert stated("TIFF", dpi=(0, 0)) is None
    assert stated("JPEG", exif=exif(0, 300)) is None


def test_the_proportion_of_pixels_is_none() -> None:
    out = io.BytesIO()
    Image.new("RGB", (40, 30)).save(out, "PNG", dpi=(300, 300))
    made = out.getvalue()
    at = made.index(b"pHYs")
    chunk = bytearray(made[at : at + 13])
    chunk[12] = 0  # unit: unknown
    changed = made[:at] + bytes(chunk) + zlib.crc32(chunk).to_bytes(4, "big") + made[at + 17 :]
    facts = image_facts(changed)
    assert facts
    assert facts.resolution is None


def test_a_jpeg_header_counts_more_than_its_exif() -> None:
    assert stated("JPEG", dpi=(200, 200), exif=exif(72, 72)) == (200, 200)
    assert stated("JPEG", dpi=(200, 200), exif=exif(300, 300)) == (200, 200)
