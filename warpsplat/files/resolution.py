"""The resolution that image files state."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from PIL import ExifTags, Image

RANGE = (1.0, 1e6)
"""Resolutions that are taken seriously [pixels per inch], from a pixel an inch to a tenth of a wavelength."""

PER_INCH = {2: 1.0, 3: 2.54}
"""Inches over the unit of a resolution, by EXIF's and TIFF's numbers of inches and centimetres."""

INCH, DEFAULT_UNIT = 1, 2
"""JFIF's number of inches, and EXIF's, which is the default there."""

SWAPPED = range(5, 9)
"""Orientations in EXIF whose sides are swapped."""


class Resolution(NamedTuple):
    """Pixels an inch, of the upright image."""

    x: float
    y: float


def resolution_of(image: Image.Image) -> Resolution | None:
    """Return the resolution that the header of an image, not yet turned upright, states; None if it states
    none.

    A mere proportion of pixels is none, nor is a pixel an inch, nor what EXIF prescribes for unknown ones.
    """
    exif = image.getexif()
    found = _in_header(image) or _in_exif(exif)
    if found and exif.get(ExifTags.Base.Orientation) in SWAPPED:
        return Resolution(found.y, found.x)
    return found


def _in_header(image: Image.Image) -> Resolution | None:
    """Return the resolution in the format's own fields."""
    info = image.info
    if image.format in {"JPEG", "MPO"}:  # whose "dpi" Pillow may have made up
        unit, density = info.get("jfif_unit", 0), info.get("jfif_density")
        return _valid(density, PER_INCH.get(unit - INCH + DEFAULT_UNIT))
    return _valid(info.get("dpi"))


def _in_exif(exif: Image.Exif) -> Resolution | None:
    """Return the resolution in EXIF."""
    sides = exif.get(ExifTags.Base.XResolution), exif.get(ExifTags.Base.YResolution)
    found = _valid(sides, PER_INCH.get(exif.get(ExifTags.Base.ResolutionUnit, DEFAULT_UNIT)))
    unknown = 72.0  # the resolution that the EXIF standard prescribes where none is known [pixels per inch]
    return None if found == (unknown, unknown) else found


def _valid(density: Any, per_inch: float | None = 1.0) -> Resolution | None:
    """Return two numbers of pixels as a resolution; None unless both are within ``RANGE``."""
    try:
        x, y = (float(side) * (per_inch or math.nan) for side in density)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    low, high = RANGE
    return Resolution(x, y) if low < x <= high and low < y <= high else None
