"""Inked areas much broader than the pen: what a pen fills, ring in ring."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Bools, Floats
from warpsplat.portable import filters

BROAD = 2.0
"""Half the width from which on ink is an area, over the width of the lines."""

USUAL = 0.75
"""Share of the lines' length that is no broader than what counts as their width: much is texture."""

FILLING = 1.2
"""Width of the lines that fill areas, at the least [px]."""

OVERLAP = 0.15
"""Of neighbouring rings, over their width."""

SMALLEST = 8
"""Points of a ring at the least."""


def pen_width(mask: Bools) -> float:
    """The usual width of the lines in a mask [px]."""
    away = filters.distance(mask)
    ridge = mask & (away >= cv2.dilate(away, np.ones((3, 3), np.uint8)))
    return max(1.0, 2 * float(np.quantile(away[ridge], USUAL)) - 1) if ridge.any() else 1.0


def hollowed(ink: Ink) -> tuple[Ink, list[Floats], float]:
    """Ink whose areas are hollow but for a line around them, and the rings that fill them.

    Returns:
        The ink; closed rings, shape (point, 2) each [px]; and their width [px].
    """
    width = max(pen_width(ink.mask), FILLING)
    away = filters.distance(np.pad(ink.mask, 1))[1:-1, 1:-1]
    inner = away > width
    # Not along the lines that an area goes over into.
    core = (away > BROAD * width).astype(np.uint8)
    side = 2 * round(BROAD * width) + 1
    inner &= cv2.dilate(core, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))) > 0
    if not inner.any():
        return ink, [], width
    step = (1 - OVERLAP) * width
    levels = np.arange(width + 0.5 * width - OVERLAP * width, float(away.max()), step)
    rings = [ring for level in levels for ring in _rings(inner & (away > level))]
    hollow = replace(ink, mask=ink.mask & ~inner, cover=np.where(inner, 0, ink.cover).astype(np.float32))
    return hollow, rings, width


def _rings(inside: Bools) -> list[Floats]:
    """The outlines of a mask."""
    found, _ = cv2.findContours(inside.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    return [contour.reshape(-1, 2) + 0.5 for contour in found if len(contour) >= SMALLEST]
