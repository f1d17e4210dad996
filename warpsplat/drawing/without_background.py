"""Opacity and colours, without the ground's, of objects photographed on plain ground."""

from __future__ import annotations

import math

import cv2
import numpy as np

from warpsplat.drawing.plain_ground import find_ground
from warpsplat.drawing.trace.grids import Bools, Floats, depth, dilated, eroded, nearest_in
from warpsplat.portable.filters import boxed, gaussian_blur
from warpsplat.scene import FloatArray

MOST_PIXELS = 1_000_000
"""Pixels of an image in which ground is looked for: a shadow begins gradually at this size."""

CORE = 5.0
"""Distance from the ground from which on a pixel is surely none [px]; edges are less wide."""

RIDGE, RIDGE_SIDE = 0.75, 9
"""Share of the largest distance from the ground around a pixel, for the middle of thin parts."""

LEAST_PART = 2e-4
"""Least part or hole, over the image: smaller ones are dust."""

BLUR = 0.4
"""Standard deviation by which noise is removed [px of that size]."""

SMOOTHING = 2.0
"""Standard deviation by which outlines are smoothed, which are along pixels [px]."""

GROUND, OBJECT, EDGE = 1, 2, -1
"""Numbers of what a pixel shows."""


def opacity_on_ground(image: FloatArray, *, everywhere: bool) -> FloatArray:
    """Return how much of each pixel is not the ground, shape (height, width).

    Args:
        image: sRGB in [0, 1], shape (height, width, 3).
        everywhere: Whether ground is looked for also where it does not reach the border.
    """
    height, width = image.shape[:2]
    factor = max(1, math.ceil(math.sqrt(height * width / MOST_PIXELS)))
    levels = np.asarray(image, np.float32) * 255
    found = ~find_ground(boxed(levels, factor) if factor > 1 else levels, everywhere=everywhere).mask
    found = np.repeat(np.repeat(found, factor, axis=0), factor, axis=1)[:height, :width]
    # Beyond the border of the image all goes on as it is there.
    soft = gaussian_blur(_objects(levels, found, factor), SMOOTHING, "replicate")
    # The smooth outline, with edges a pixel wide.
    width_of_edge = math.sqrt(2 * math.pi) * SMOOTHING
    return np.asarray(np.clip(width_of_edge * (soft - 0.5) + 0.5, 0, 1), np.float32)


def without_ground(image: FloatArray, *, everywhere: bool) -> FloatArray:
    """Return an image with opacity, premultiplied, shape (height, width, 4); arguments as above.

    Pixels at edges have the colours of the nearest ones inside, so that nothing of the ground is left.
    """
    opacity = opacity_on_ground(image, everywhere=everywhere)[..., None]
    whole = opacity[..., 0] == 1
    colors = image.reshape(-1, 3)[nearest_in(whole)] if whole.any() else image
    return np.concatenate([colors * opacity, opacity], axis=2)


def _objects(levels: Floats, found: Bools, factor: int) -> Floats:
    """Return the shares of objects in pixels.

    Those ``found`` to be no ground reach beyond the edges of objects. Edges are where colours change most
    between what is surely ground and surely object: the watershed. ``factor``: pixels along one in which they
    were found.
    """
    inside = depth(found)
    side = RIDGE_SIDE * factor
    around = cv2.dilate(inside, np.ones((side, side), np.uint8))
    core = found & (inside > factor) & (inside >= np.minimum(CORE * factor, RIDGE * around))
    marks = np.where(eroded(~found, 2 * factor + 1), GROUND, np.where(core, OBJECT, 0)).astype(np.int32)
    soft = np.round(np.clip(gaussian_blur(levels, BLUR * factor), 0, 255)).astype(np.uint8)
    # The watershed leaves the border of an image open.
    framed = cv2.copyMakeBorder(soft, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    shown = cv2.watershed(framed, np.pad(marks, 1, mode="edge"))[1:-1, 1:-1]
    is_object = shown == OBJECT
    is_object = _without_specks(_without_specks(is_object), holes=True)
    # The watershed is a line of pixels between both.
    is_edge = (shown == EDGE) & dilated(is_object, 3) & ~is_object
    return np.asarray(is_object + np.float32(0.5) * is_edge, np.float32)


def _without_specks(mask: Bools, *, holes: bool = False) -> Bools:
    """Return a mask without its smallest parts, or without the smallest ones of what is not in it."""
    inside = ~mask if holes else mask
    _, parts = cv2.connectedComponents(inside.astype(np.uint8), connectivity=4 if holes else 8)
    sizes = np.bincount(parts.reshape(-1))
    is_large = sizes >= LEAST_PART * mask.size
    is_large[0] = False
    kept = is_large[parts]
    return ~kept if holes else kept
