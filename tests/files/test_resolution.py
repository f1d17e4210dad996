"""Resolutions that image files state."""

from __future__ import annotations

import io
import zlib
from typing import Any

import pytest
from PIL import ExifTags, Image

from warpsplat.files.image import image_facts
from warpsplat.files.resolution import resolution_of


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


def test_what_is_none() -> None:
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
