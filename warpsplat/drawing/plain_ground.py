"""The plain ground of a photograph: a smooth field of its colours, with soft shadows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, channel_max, dilated, eroded
from warpsplat.portable.filters import boxed, gaussian_blur, sobel
from warpsplat.portable.linear import product, solve

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

LEAST_SHADE, BRIGHTEST = 0.4, 1.25
"""How dark soft shadows are, over the ground in light, and how bright spots of light."""

HUE = 12.0
"""How far the colour of a shadow is off that of darker ground [levels]: light from elsewhere tints it."""

BRIGHT = 252.0
"""Levels from which on the true brightness is not known."""

STEEP = 8.0
"""Slope from which on something is the edge of an object rather than of a soft shadow [levels a pixel]."""

PASSAGE = 5
"""Width of gaps in the edge of an object through which no shadow flows in [px]."""


@dataclass(frozen=True)
class Ground:
    """The ground of a photograph."""

    field: Floats
    """Its colours without shadows [levels], shape (height, width, 3)."""
    mask: Bools
    """The pixels that show it, in light or in soft shadow, shape (height, width)."""
    noise: float
    """How far pixels in light are off the field [levels]."""


def find_ground(levels: Floats, *, everywhere: bool) -> Ground:
    """Return the ground of a photograph: what is like its border, smooth changes of light and shadow aside.

    Args:
        levels: sRGB, 0..255, shape (height, width, 3).
        everywhere: Also where it does not reach the border of the image.
    """
    field = _field(levels)
    soft = gaussian_blur(np.asarray(levels, np.float32), 1.0)
    off = channel_max(np.abs(soft - field))
    noise = max(LEAST_NOISE, 1.5 * float(np.median(off[_frame(off.shape)])))
    is_lit = off <= OUTLIERS * noise
    shade = (soft * field).sum(axis=2) / np.maximum((field * field).sum(axis=2), 1)
    tint = channel_max(np.abs(soft - shade[..., None] * field))
    across, down = sobel(soft.mean(axis=2))
    is_flat = np.maximum(np.abs(across), np.abs(down)) <= 8 * max(STEEP, noise)
    is_shadow = (shade >= LEAST_SHADE) & (shade <= BRIGHTEST) & (tint <= max(HUE, OUTLIERS * noise)) & is_flat
    wide = dilated(eroded(is_lit | is_shadow, PASSAGE), PASSAGE)
    _, parts = cv2.connectedComponents((wide | is_lit).astype(np.uint8), connectivity=4)
    seeds = parts[is_lit & (_frame(off.shape) | everywhere) & wide]
    is_ground = np.isin(parts, np.unique(seeds)) & (parts > 0)
    return Ground(field, is_ground, noise)


def _frame(shape: tuple[int, ...]) -> Bools:
    """Return the pixels along the border of an image."""
    width = max(2, math.ceil(BORDER * min(shape)))
    found = np.ones(shape, np.bool_)
    found[width:-width, width:-width] = False
    return found


def _terms(shape: tuple[int, ...]) -> Floats:
    """Return the terms of a polynomial of the second degree at each pixel, shape (height, width, 6)."""
    y, x = ((np.arange(side) + 0.5) / side - 0.5 for side in shape)
    x, y = np.broadcast_arrays(x[None, :], y[:, None])
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)


def _field(levels: Floats) -> Floats:
    """Return the smooth field of colours that most of the border has, and what is like that in the image."""
    small = boxed(np.asarray(levels, np.float32), max(1, min(levels.shape[:2]) // FIELD_SIDE))
    terms, colors = _terms(small.shape[:2]).reshape(-1, 6), small.reshape(-1, 3).astype(np.float64)
    frame, is_bright = _frame(small.shape[:2]).reshape(-1), colors >= BRIGHT
    middle = np.median(colors[frame], axis=0)
    off = channel_max(np.abs(colors - middle))
    for where in (frame, np.ones_like(frame)):
        for _ in range(ROUNDS):
            scale = max(LEAST_NOISE, 1.5 * float(np.median(off[frame])))
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
    whole = product(_terms(levels.shape[:2]).reshape(-1, 6).astype(np.float32), found.astype(np.float32))
    return np.minimum(whole.reshape(levels.shape), np.float32(255))
