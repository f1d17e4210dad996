"""Lines thinner than a pixel: how much ink lies across them does not depend on how pixels share it."""

from __future__ import annotations

import math

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools
from warpsplat.portable import filters
from warpsplat.scene import FloatArray

SPREAD = 0.8  # [px] standard deviation of the filter by which ink across lines is measured

FAINT, SURE = 0.12, 0.25
"""Ink across a line from which on it goes on, and that it must have somewhere [px of full ink]."""

NOISY = 3.0  # the same in standard deviations of the noise, over SPREAD
MIDDLE = 0.5  # share that the middle of a line has of the largest amount beside it
LONG = 5  # [px] of a thin line that goes on from one place only, at the least


def across(ink: FloatArray, fine: int = 1) -> FloatArray:
    """Return how much ink lies across a thin line through each pixel [px of full ink]; nothing beside lines.

    A line of mass m that is blurred to s has the second derivative -m / (sqrt(2 pi) s^3) in its middle.

    Args:
        ink: Share of full ink, shape (height, width).
        fine: Pixels of the result on a pixel's side.

    Returns:
        Shape (fine * height, fine * width); less than their width in broader lines.
    """
    if fine > 1:
        ink = filters.resize_cubic(ink, (ink.shape[1] * fine, ink.shape[0] * fine))
    soft = filters.gaussian_blur(ink, SPREAD * fine, "replicate")
    padded = np.pad(soft, 1, mode="edge")
    middle = padded[1:-1, 1:-1]
    xx = padded[1:-1, 2:] - 2 * middle + padded[1:-1, :-2]
    yy = padded[2:, 1:-1] - 2 * middle + padded[:-2, 1:-1]
    xy = 0.25 * (padded[2:, 2:] + padded[:-2, :-2] - padded[2:, :-2] - padded[:-2, 2:])
    bend = 0.5 * (xx + yy) - np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    spread = fine * math.sqrt(SPREAD * SPREAD + 1 / 12)  # with that of the pixels
    scale = math.sqrt(2 * math.pi) * spread * spread * spread / fine
    return np.asarray(np.maximum(-bend, 0) * scale, np.float32)


def middles(mass: FloatArray, least: float, fine: int = 1) -> Bools:
    """Return the pixels in the middle of lines with at least so much ink across; arguments as ``across``."""
    most = cv2.dilate(mass, np.ones((2 * fine + 1, 2 * fine + 1), np.uint8))
    return np.asarray((mass > least) & (mass > MIDDLE * most), np.bool_)


def with_thin(mask: Bools, thin: Bools, fine: int = 1) -> Bools:
    """Add thin lines to a mask that go on where it ends, or that are long; not the tips of its corners.

    Args:
        mask: Of ink, shape (height, width).
        thin: Middles of lines, shape (height, width).
        fine: Pixels of both on a pixel's side.
    """
    _, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    count, links, stats, _ = cv2.connectedComponentsWithStats((thin & ~mask).astype(np.uint8), connectivity=8)
    rows, columns = np.nonzero(links)
    padded = np.pad(parts, 1)
    beside = np.stack([padded[rows + down, columns + right] for down in range(3) for right in range(3)])
    pairs = np.stack([np.broadcast_to(links[rows, columns], beside.shape), beside], axis=-1).reshape(-1, 2)
    pairs = np.unique(pairs[pairs[:, 1] > 0], axis=0)
    held = np.bincount(pairs[:, 0], minlength=count) > 1
    held |= stats[:, cv2.CC_STAT_AREA] >= LONG * fine * fine
    held[0] = False
    return np.asarray(mask | held[links], np.bool_)
