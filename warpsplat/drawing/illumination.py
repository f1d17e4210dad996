"""Smooth fields of colour: the plain ground of a photograph, or paper in uneven light."""

from __future__ import annotations

import math

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, channel_max
from warpsplat.drawing.trace.regions import MOST_NOISE
from warpsplat.fit.optics import Illumination
from warpsplat.portable.filters import boxed
from warpsplat.portable.linear import product, solve
from warpsplat.scene import FloatArray

FIELD_SIDE = 200
"""Shorter side of the image that a field is fitted to [px]."""

BORDER = 1 / 24
"""Width of the border that ground is looked for in, over the shorter side."""

ROUNDS = 12
"""Rounds of a robust fit."""

OUTLIERS = 4.0
"""How far pixels of the ground are off its field, over their noise."""

LEAST_NOISE = 1.25
"""Noise of any ground [levels]: paper has a texture, and JPEG adds to it."""

BRIGHT = 252.0
"""Levels from which on the true brightness is not known."""

ALL = slice(None)

STRIP = 64
"""Rows that are handled together, which bounds the memory."""

MOST_TOLD = 1 << 20
"""Pixels that tell whether light is uneven, about, which bounds time and memory."""

LEAST_PAPER, BRIGHT_PAPER = 0.25, 128.0
"""Share of the image that is paper, at the least, and its mean level in the best light."""

LEAST_TEXTURE = 2.0
"""Least noise of paper [levels]: that of a JPEG of a drawn gradient is about one level."""

LEAST_LIGHT = 0.2
"""Light on the darkest part of paper, relative to the brightest."""

UNEVEN = 0.75
"""Share of the squared error of an even ground that uneven light must leave less than."""


def find_illumination(image: FloatArray) -> Illumination | None:
    """Return the uneven light that may be on the paper of a scan or photographed page; None if it is even.

    Paper is bright, surrounds what is drawn, and has a texture. A drawn gradient may have all that, too:
    only traces with and without the light tell.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3).
    """
    if image.shape[2] != 3:
        return None
    factor = small_factor(image)
    height, width = (side - side % factor for side in image.shape[:2])
    found = fit_field(boxed(image[:height, :width], factor) * np.float32(255))
    rows = slice(None, None, 1 + image[..., 0].size // MOST_TOLD)
    some, field = image[rows] * np.float32(255), field_at(found, image.shape[:2], rows)
    off = channel_max(np.abs(some - field))
    noise = noise_around(off)
    is_paper = off <= OUTLIERS * noise
    if noise > MOST_NOISE or is_paper.mean() < LEAST_PAPER or 2 * is_paper[frame(off.shape)].mean() < 1:
        return None
    paper, light = some[is_paper].astype(np.float64), field[is_paper].astype(np.float64)
    greatest = light.max(axis=0)
    if greatest.mean() < BRIGHT_PAPER or (field / greatest).min() < LEAST_LIGHT:
        return None
    texture, even = np.square(paper - light).mean(), np.square(paper - paper.mean(axis=0)).mean()
    if texture < LEAST_TEXTURE**2 or texture >= UNEVEN * even:
        return None
    return tuple(tuple(each) for each in (found / greatest).T.tolist())


def evened(image: FloatArray, illumination: Illumination) -> FloatArray:
    """Return an image, sRGB in [0, 1], as it would be in even light, in whole levels."""
    found = np.empty_like(image)
    for top in range(0, len(image), STRIP):
        rows = slice(top, top + STRIP)
        levels = np.round(image[rows] * np.float32(255) / relative(illumination, image, rows))
        found[rows] = np.minimum(levels, 255) / np.float32(255)
    return found


def relative(illumination: Illumination, image: FloatArray, rows: slice = ALL) -> FloatArray:
    """Return the light on some rows of an image, relative to the brightest paper, shape (row, width, 3)."""
    light = _at(np.array(illumination).T, image.shape[:2], rows)
    return np.asarray(np.maximum(light, np.float32(LEAST_LIGHT)), np.float32)


def frame(shape: tuple[int, ...]) -> Bools:
    """Return the pixels along the border of an image."""
    width = max(2, math.ceil(BORDER * min(shape)))
    found = np.ones(shape, np.bool_)
    found[width:-width, width:-width] = False
    return found


def noise_around(off: Floats) -> float:
    """Return the noise of a ground by how far pixels are off its field [levels], shape (height, width)."""
    return max(LEAST_NOISE, 1.5 * float(np.median(off[frame(off.shape)])))


def fit_field(levels: Floats) -> Floats:
    """Return the smooth field of colours that most of the border has, and what is like that in the image.

    As coefficients of ``_terms``, shape (6, 3). ``levels``: sRGB, 0..255, shape (height, width, 3).
    """
    small = boxed(np.asarray(levels, np.float32), small_factor(levels))
    terms, colors = _terms(small.shape[:2]).reshape(-1, 6), small.reshape(-1, 3).astype(np.float64)
    border, is_bright = frame(small.shape[:2]).reshape(-1), colors >= BRIGHT
    middle = np.median(colors[border], axis=0)
    off = channel_max(np.abs(colors - middle))
    for where in (border, np.ones_like(border)):
        for _ in range(ROUNDS):
            scale = max(LEAST_NOISE, 1.5 * float(np.median(off[border])))
            weights = np.where(
                where, np.square(np.clip(1 - np.square(off / (2 * OUTLIERS * scale)), 0, 1)), 0
            )
            weighted = terms * weights[:, None]
            # A little stiffness: what no pixel tells stays even.
            matrix = product(weighted.T, terms) + np.diag([0, *5 * [1e-3 * weights.sum() + 1e-9]])
            matrix[0, 0] += 1e-9
            found = solve(matrix, product(weighted.T, colors))
            even = product(terms, found)
            off = channel_max(np.abs(colors - np.minimum(even, 255)))
            # Where it is too bright for the camera, the field may be any brighter.
            colors = np.where(is_bright, np.maximum(even, 255), colors)
    return np.asarray(found)


def small_factor(image: Floats) -> int:
    """Return how many times smaller an image is that a field is fitted to."""
    return max(1, min(image.shape[:2]) // FIELD_SIDE)


def field_at(found: Floats, shape: tuple[int, ...], rows: slice = ALL) -> Floats:
    """Return a field of ``fit_field`` on some rows of an image [levels], shape (row, width, 3)."""
    return np.minimum(_at(found, shape, rows), np.float32(255))


def _at(found: Floats, shape: tuple[int, ...], rows: slice) -> Floats:
    """Return polynomials at the pixels of some rows of an image, shape (row, width, polynomial)."""
    y, x = (side.astype(np.float32)[:, None] for side in _sides(shape))
    one, across, down, twice, both, twice_down = found.astype(np.float32)[:, None, None]
    y = y[rows, None]
    return np.asarray(one + down * y + twice_down * y * y + (across + both * y) * x + twice * (x * x))


def _terms(shape: tuple[int, ...]) -> Floats:
    """Return the terms of a polynomial of the second degree at each pixel, shape (height, width, 6).

    1, x, y, x², xy and y², where x and y go from -1/2 to 1/2.
    """
    y, x = _sides(shape)
    x, y = np.broadcast_arrays(x[None, :], y[:, None])
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)


def _sides(shape: tuple[int, ...]) -> list[Floats]:
    """Return y of the rows of an image and x of its columns."""
    return [(np.arange(side) + 0.5) / side - 0.5 for side in shape]
