"""The plain ground of a photograph: a smooth field of its colours, with soft shadows."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.illumination import OUTLIERS, field_at, fit_field, frame, noise_around
from warpsplat.drawing.trace.grids import Bools, Floats, channel_max, dilated, eroded
from warpsplat.portable.filters import gaussian_blur, sobel

LEAST_SHADE, BRIGHTEST = 0.4, 1.25
"""How dark soft shadows are, over the ground in light, and how bright spots of light."""

HUE = 12.0
"""How far the colour of a shadow is off that of darker ground [levels]: light from elsewhere tints it."""

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
    field = field_at(fit_field(levels), levels.shape[:2])
    soft = gaussian_blur(np.asarray(levels, np.float32), 1.0)
    off = channel_max(np.abs(soft - field))
    noise = noise_around(off)
    is_lit = off <= OUTLIERS * noise
    shade = (soft * field).sum(axis=2) / np.maximum((field * field).sum(axis=2), 1)
    tint = channel_max(np.abs(soft - shade[..., None] * field))
    across, down = sobel(soft.mean(axis=2))
    is_flat = np.maximum(np.abs(across), np.abs(down)) <= 8 * max(STEEP, noise)
    is_shadow = (shade >= LEAST_SHADE) & (shade <= BRIGHTEST) & (tint <= max(HUE, OUTLIERS * noise)) & is_flat
    wide = dilated(eroded(is_lit | is_shadow, PASSAGE), PASSAGE)
    _, parts = cv2.connectedComponents((wide | is_lit).astype(np.uint8), connectivity=4)
    seeds = parts[is_lit & (frame(off.shape) | everywhere) & wide]
    is_ground = np.isin(parts, np.unique(seeds)) & (parts > 0)
    return Ground(field, is_ground, noise)
