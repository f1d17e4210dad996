"""Images without the noise of their flat colours, so that noise is no property that a drawing has.

What is left are mixtures of colours at edges, whose noise is that of their shares: hundredths of a pixel.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, channel_max
from warpsplat.drawing.trace.lattice import MOST_COLORS
from warpsplat.drawing.trace.regions import MOST_NOISE, NEGLIGIBLE_NOISE
from warpsplat.drawing.trace.seeds import OUTLIERS, noise_of
from warpsplat.scene import FloatArray

LEAST_FLAT = 16
"""Pixels of a flat colour: a block of four by four."""

WINDOW = 9
"""Side of the square in which noise averages out [px]; where the mean is off, the colour is no flat one."""


def without_noise(image: FloatArray) -> tuple[FloatArray, float | None]:
    """Return an image whose flat colours have no noise, and the noise that mixtures of colours still have.

    Without noise the image stays as it is. So it does without flat colours; the noise is None then.
    """
    levels = np.asarray(image, np.float32) * 255
    noise = noise_of(levels)
    if not noise:
        return image, 0.0
    if noise > MOST_NOISE:
        return image, None
    whole = np.round(levels).astype(np.int32)
    reach = math.ceil(2 * noise) + 1
    clean = levels.copy()
    for color in _flat_colors(whole, reach):
        _flatten(clean, whole, color, reach, noise)
    if noise_of(clean) >= NEGLIGIBLE_NOISE:
        return image, None
    return clean / np.float32(255), noise


def _flat_colors(whole: Ints, reach: int) -> list[Ints]:
    """Return the colours of flat areas, the most frequent first. ``reach``: how far noise spreads one."""
    square = np.ones((3, 3), np.uint8)
    values = whole.astype(np.uint8)
    flat = channel_max(cv2.dilate(values, square).astype(np.int32) - cv2.erode(values, square)) <= 2 * reach
    colors, counts = np.unique(whole[flat], axis=0, return_counts=True)
    found: list[Ints] = []
    while len(colors) and len(found) < MOST_COLORS:
        away = np.abs(colors - colors[counts.argmax()]).max(axis=1)
        near = away <= reach
        total = counts[near].sum()
        if total < LEAST_FLAT:
            break
        mean = (colors[near] * counts[near, None]).sum(axis=0) / total
        found.append(np.round(mean).astype(np.int32))
        rest = away > OUTLIERS * reach  # what is nearer are outliers of this colour's noise
        colors, counts = colors[rest], counts[rest]
    return found


def _flatten(clean: Floats, whole: Ints, color: Ints, reach: int, noise: float) -> None:
    """Give a flat colour to the pixels that have it but for noise: the mean of those around is about it."""
    away = whole - color
    near: Bools = channel_max(np.abs(away)) <= reach
    total = _sums(near.astype(np.float32))
    off = channel_max(np.abs(_sums(np.where(near[..., None], away, 0).astype(np.float32))))
    clean[near & (off <= (1 + noise / 2) * total)] = color


def _sums(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the sums of whole numbers in the square around each pixel, exactly."""
    return np.asarray(cv2.boxFilter(values, cv2.CV_32F, (WINDOW, WINDOW), normalize=False), np.float32)
