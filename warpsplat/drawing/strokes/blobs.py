"""Inked areas much broader than the pen, which a pen fills with rings."""

from __future__ import annotations

import cv2
import numpy as np

from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Bools, Floats, depth
from warpsplat.portable import filters

USUAL = 0.75  # quantile of the width along all lines that counts as theirs: much of the rest is texture
BROAD = 2.0  # half the width from which on ink is an area, over the width of the lines
FILLING = 1.2  # [px] width of the lines that fill areas, at the least
OVERLAP = 0.15  # of neighbouring rings, over their width
SMALLEST = 8  # points of a ring, at the least


def pen_width(mask: Bools) -> float:
    """Return the usual width of the lines in a mask [px]."""
    away = np.minimum(filters.distance(mask), sum(mask.shape))  # infinite where all is ink
    ridge = mask & (away >= cv2.dilate(away, np.ones((3, 3), np.uint8)))
    return max(1.0, 2 * float(np.quantile(away[ridge], USUAL)) - 1) if ridge.any() else 1.0


def hollowed(ink: Ink) -> tuple[Ink, list[Floats], float]:
    """Return ink whose areas are hollow except for a line around them, and the rings that fill them.

    Returns:
        The ink; closed rings, shape (point, 2) each [px]; and their width [px].
    """
    width = max(pen_width(ink.mask), FILLING)
    away = depth(ink.mask)
    # Not along lines that an area continues as.
    core = (away > BROAD * width).astype(np.uint8)
    side = 2 * round(BROAD * width) + 1
    near_core = cv2.dilate(core, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))) > 0
    inner = (away > width) & near_core
    if not inner.any():
        return ink, [], width
    rings: list[Floats] = []
    levels = np.arange(width + 0.5 * width - OVERLAP * width, float(away.max()), (1 - OVERLAP) * width)
    for level in levels:
        mask = (inner & (away > level)).astype(np.uint8)
        found, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        rings += [contour.reshape(-1, 2) + 0.5 for contour in found if len(contour) >= SMALLEST]
    return ink.without(inner), rings, width
