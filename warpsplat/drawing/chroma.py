"""Colours at half the resolution of lightness, as JPEG and WebP keep them (4:2:0).

What is beside an edge has the colours of both sides then; lightness tells where it is. A few pixels have two
colours, mostly, whose mixtures lie on a line: halved colours depend on halved lightness in the same way as
whole ones on whole lightness. That line is found in small windows, and gives colours at full resolution.
"""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats
from warpsplat.drawing.trace.seeds import ROUNDING, noise_of
from warpsplat.portable import filters
from warpsplat.scene import FloatArray

BLURRED = 0.75
"""Sharpness of colours over that of lightness, below which their resolution is lower."""

WINDOW = 5
"""Side of the squares in which colours are on a line [px]: some blocks of two by two."""

OUTWARD = 1e-3
"""Penalty of a window by the square of its middle's distance [levels squared], which decides between those
without error."""


def has_blurred_colors(image: FloatArray) -> bool:
    """Return whether an image has noise, and the edges of its colours are less sharp than those of lightness.

    ``image``: as for ``finish_drawing``; one that is transparent somewhere is no JPEG.
    """
    if image.shape[2] == 4 and image[..., 3].min() < 1:
        return False
    image = image[..., :3]
    if not noise_of(image * np.float32(255)):
        return False
    light = filters.grey(image)[..., None]
    return _sharpness(image - light) < BLURRED * _sharpness(light)


def _sharpness(image: FloatArray) -> float:
    """Return the sum of the squared second differences along rows and columns over that of the first ones."""
    sums = [sum(float((np.diff(image, n, axis) ** 2).sum()) for axis in (0, 1)) for n in (1, 2)]
    return sums[1] / sums[0] if sums[0] > 0 else np.inf


def halved(image: Floats) -> Floats:
    """Return levels, shape (height, width, 3 or 4), with colours averaged over squares of two pixels.

    The first square begins at the upper left corner; between their middles, decoders interpolate.
    """
    light = filters.grey(image[..., :3])[..., None]
    found = image.copy()
    found[..., :3] = np.clip(np.round(light + _halved(image[..., :3] - light)), 0, 255)
    return found


def _halved(values: Floats) -> Floats:
    """Return values, shape (height, width, channel), averaged over squares of two pixels and interpolated."""
    height, width = values.shape[:2]
    small = filters.boxed(values, 2)
    wide = filters.resize_linear(small, (2 * small.shape[1], 2 * small.shape[0]))
    return wide[:height, :width]


def with_sharp_colors(image: FloatArray) -> FloatArray:
    """Return an image whose colours were halved with colours as sharp as its lightness.

    ``image``: sRGB in [0, 1], shape (height, width, 3), or with opacity that is 1 everywhere.
    """
    levels = np.round(image[..., :3].astype(np.float64) * 255)
    light = filters.grey(levels)[..., None]
    colors, soft = levels - light, _halved(light)
    mean, means = filters.box_blur(soft, WINDOW), filters.box_blur(colors, WINDOW)
    spread = np.maximum(filters.box_blur(soft * soft, WINDOW) - mean * mean, 0)
    both = filters.box_blur(colors * soft, WINDOW) - means * mean
    slope = both / (spread + ROUNDING)
    error = (filters.box_blur(colors * colors, WINDOW) - means * means - slope * both).sum(axis=2)
    reach = WINDOW // 2
    error, slope, start = (
        np.pad(each, [(reach, reach)] * 2 + [(0, 0)] * (each.ndim - 2), mode="edge")
        for each in (np.round(np.maximum(error, 0) / OUTWARD), slope, means - slope * mean)
    )
    height, width = levels.shape[:2]
    least, found = np.full((height, width), np.inf), levels
    for y, x in np.ndindex(WINDOW, WINDOW):
        there = np.s_[y : y + height, x : x + width]
        cost = error[there] + (y - reach) * (y - reach) + (x - reach) * (x - reach)
        better: Bools = cost < least
        least = np.where(better, cost, least)
        found = np.where(better[..., None], light + start[there] + slope[there] * light, found)
    sharp = image.copy()
    sharp[..., :3] = np.clip(np.round(found), 0, 255) / 255
    return sharp
