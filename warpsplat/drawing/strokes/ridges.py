"""Lines thinner than a pixel: how much ink lies across them does not depend on how pixels share it."""

from __future__ import annotations

import math

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools
from warpsplat.portable import filters
from warpsplat.scene import FloatArray

SPREAD = 0.8
"""Standard deviation of the filter that looks across lines [px]."""

FAINT, SURE = 0.12, 0.25
"""Ink across a line from which on it goes on, and that it must have somewhere [px of full ink]."""

NOISY = 3.0
"""The same in standard deviations of the noise, over SPREAD."""

MIDDLE = 0.5
"""Share of the most beside it that the middle of a line has."""

LONG = 5
"""Pixels of a thin line that goes on from one place only, at the least."""


def across(ink: FloatArray, fine: int = 1) -> FloatArray:
    """How much ink lies across a thin line through each pixel [px of full ink]; nothing beside lines.

    A line of mass m that is blurred to s has the second derivative -m / (sqrt(2 pi) s^3) in its middle.

    Args:
        ink: share of full ink, shape (height, width).
        fine: pixels of the result on a pixel's side.

    Returns:
        shape (fine * height, fine * width); of broader lines less than their width.
    """
    if fine > 1:
        size = (ink.shape[1] * fine, ink.shape[0] * fine)
        ink = filters.resize_cubic(ink, size)
    soft = filters.gaussian_blur(ink, SPREAD * fine, "replicate")
    padded = np.pad(soft, 1, mode="edge")
    middle = padded[1:-1, 1:-1]
    xx = padded[1:-1, 2:] - 2 * middle + padded[1:-1, :-2]
    yy = padded[2:, 1:-1] - 2 * middle + padded[:-2, 1:-1]
    xy = 0.25 * (padded[2:, 2:] + padded[:-2, :-2] - padded[2:, :-2] - padded[:-2, 2:])
    bend = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    spread = fine * math.sqrt(SPREAD * SPREAD + 1 / 12)  # with that of the pixels
    return np.asarray(
        np.maximum(-bend, 0) * (math.sqrt(2 * math.pi) * spread * spread * spread / fine), np.float32
    )


def middles(mass: FloatArray, least: float, fine: int = 1) -> Bools:
    """The pixels in the middle of lines of at least so much ink across; arguments as ``across`` has them."""
    most = cv2.dilate(mass, np.ones((2 * fine + 1, 2 * fine + 1), np.uint8))
    return np.asarray((mass > least) & (mass > MIDDLE * most), np.bool_)


def with_thin(mask: Bools, thin: Bools, fine: int = 1) -> Bools:
    """A mask with the thin lines that go on where it ends, or that are long; not with tips of its corners.

    Args:
        mask: of ink, shape (height, width).
        thin: middles of lines, of the same shape.
        fine: pixels of both on a pixel's side.
    """
    _, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    count, links, stats, _ = cv2.connectedComponentsWithStats((thin & ~mask).astype(np.uint8), connectivity=8)
    rows, columns = np.nonzero(links)
    padded = np.pad(parts, 1)
    pairs = np.concatenate(
        [
            np.stack([links[rows, columns], padded[rows + down, columns + right]], axis=1)
            for down in range(3)
            for right in range(3)
        ]
    )
    pairs = np.unique(pairs[pairs[:, 1] > 0], axis=0)
    beside = np.bincount(pairs[:, 0], minlength=count)
    held = (beside > 1) | (stats[:, cv2.CC_STAT_AREA] >= LONG * fine * fine)
    held[0] = False
    return np.asarray(mask | held[links], np.bool_)
