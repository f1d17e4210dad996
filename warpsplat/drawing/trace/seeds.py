"""Where the picture is flat or a smooth ramp: the pixels that are sure to be of one region."""

from __future__ import annotations

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import NOBODY, Bools, Floats, Ints, largest, linked_parts

FLAT = 1.0
"""Largest step between neighbours of a flat region [levels of 255], besides noise."""

STEEP = 12.0
"""Largest step between neighbours on a ramp [levels]; what is steeper is an edge."""

BEND = 2.0
"""Largest change of that step from one pixel to the next [levels], besides noise."""

LEAST = 4
"""Pixels of a region: a block of two by two."""

LEAST_RAMP = 9
"""The same of a ramp, which antialiasing may feign."""


def noise_of(image: Floats) -> float:
    """How much flat regions vary beside their edges [levels of 255], which is where JPEG leaves its traces;
    0 for a picture that was drawn.
    """
    grey = image.max(axis=2) if image.shape[2] == 1 else image[..., :3].mean(axis=2)
    step = np.zeros(grey.shape, np.float32)
    step[:, 1:] = np.abs(np.diff(grey, axis=1))
    step[1:] = np.maximum(step[1:], np.abs(np.diff(grey, axis=0)))
    edge = (step > 24).astype(np.uint8)
    near = cv2.dilate(edge, np.ones((13, 13), np.uint8)) > 0
    apart = cv2.dilate(edge, np.ones((5, 5), np.uint8)) == 0
    ring = step[near & apart]
    if len(ring) < 64:
        ring = step.reshape(-1)
    return float(np.percentile(ring, 70))


def _steps(image: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Largest step over the channels to the right and below, and how it bends at each pixel both ways."""
    right, below = np.diff(image, axis=1), np.diff(image, axis=0)
    bend_x = np.zeros(image.shape[:2], np.float32)
    bend_y = np.zeros(image.shape[:2], np.float32)
    bend_x[:, 1:-1] = largest(np.abs(np.diff(right, axis=1)))
    bend_y[1:-1] = largest(np.abs(np.diff(below, axis=0)))
    return largest(np.abs(right)), largest(np.abs(below)), bend_x, bend_y


def find_seeds(image: Floats, noise: float) -> tuple[int, Ints]:
    """Parts that are flat or smooth.

    Args:
        image: premultiplied, 0..255, shape (height, width, channel).
        noise: of flat regions [levels].

    Returns:
        How many, and each pixel's, NOBODY where it is neither; shape (height, width).
    """
    right, below, bend_x, bend_y = _steps(image)
    flat = FLAT + noise
    flat_right, flat_below = right <= flat, below <= flat
    block = flat_right[1:] & flat_right[:-1] & flat_below[:, 1:] & flat_below[:, :-1]
    even = np.zeros(image.shape[:2], np.bool_)
    for rows in (slice(None, -1), slice(1, None)):
        for columns in (slice(None, -1), slice(1, None)):
            even[rows, columns] |= block
    smooth = _smooth(right, below, bend_x, bend_y, noise)
    across = (flat_right & even[:, 1:] & even[:, :-1]) | (smooth[:, 1:] & smooth[:, :-1])
    down = (flat_below & even[1:] & even[:-1]) | (smooth[1:] & smooth[:-1])
    _, parts = linked_parts(across, down, even | smooth)
    return _large_enough(parts, even)


def _smooth(right: Floats, below: Floats, bend_x: Floats, bend_y: Floats, noise: float) -> Bools:
    """Pixels from which the picture goes on evenly to all four sides."""
    bend, steep = BEND + noise, STEEP + noise
    smooth = (bend_x <= bend) & (bend_y <= bend)
    smooth[:, 1:] &= right <= steep
    smooth[:, :-1] &= right <= steep
    smooth[1:] &= below <= steep
    smooth[:-1] &= below <= steep
    return np.asarray(smooth)


def _large_enough(parts: Ints, even: Bools) -> tuple[int, Ints]:
    count = int(parts.max()) + 1
    if count == 0:
        return 0, parts
    inside = parts >= 0
    sizes = np.bincount(parts[inside], minlength=count)
    flats = np.bincount(parts[inside & even], minlength=count)
    keep = (sizes >= LEAST_RAMP) | (flats >= LEAST)
    number = np.where(keep, np.cumsum(keep) - 1, NOBODY).astype(np.int32)
    return int(keep.sum()), np.where(inside, number[parts], NOBODY)
