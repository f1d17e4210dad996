"""Outlines: where beside each crack between two cells the boundary lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats
from warpsplat.drawing.trace.partition import Partition
from warpsplat.drawing.trace.planar import INSIDE, LEFT, OUTSIDE, RIGHT, STEPS, Loops

TREND = 3  # cracks ahead and behind that tell the direction of an outline


@dataclass(frozen=True)
class Boundary:
    """The boundary of regions at each crack."""

    points: Floats
    """The sub-pixel place, shape (crack, 2)."""
    is_good: Bools
    """Which of them to use: horizontal cracks of flat parts of an outline, vertical ones of steep parts."""
    offsets: Floats
    """How far the boundary lies to the left of each crack [cell], shape (crack,)."""
    trends: Floats
    """Direction of the outline, not normalised, shape (crack, 2)."""


def find_boundary(loops: Loops, partition: Partition) -> Boundary:
    """Measure where the boundary lies at each crack."""
    steps, trends = STEPS[loops.directions], _trends(loops)
    normal = np.stack([steps[:, 1], -steps[:, 0]], axis=1)  # to the left, as y points down
    offsets = _offsets(loops, partition)
    points = loops.vertices + 0.5 * steps + offsets[:, None] * normal
    x, y = np.abs(trends).T
    is_level = (loops.directions == RIGHT) | (loops.directions == LEFT)
    return Boundary(points, np.where(is_level, x >= y, y > x), offsets, trends)


def _offsets(loops: Loops, partition: Partition) -> Floats:
    """Return how far the boundary lies to the left of each crack, shape (crack,).

    It is where neither colouring is ahead, if its lead changes evenly from one cell to the next.
    """
    inner, outer = loops.vertices + INSIDE[loops.directions], loops.vertices + OUTSIDE[loops.directions]
    height, width = partition.labels.shape
    real = (loops.others != NO_REGION) & ((inner >= 0) & (inner < [width, height])).all(axis=1)
    leads = np.append(partition.lead.reshape(-1), 1)  # that of whole pixels is the last
    mine, theirs = (leads[partition.labels.place(*each[real].T[::-1])] for each in (inner, outer))
    offsets = np.zeros(len(inner))
    offsets[real] = mine / np.maximum(mine + theirs, 1e-6) - 0.5
    return offsets


def _trends(loops: Loops) -> Floats:
    """Return the direction of the outline at each crack, the sum of those up to ``TREND`` ahead and behind.

    The outermost count half: on a diagonal, horizontal and vertical ones are then as many. Shape (crack, 2).
    """
    steps, sizes = STEPS[loops.directions].astype(np.float64), np.diff(loops.first)
    size, base = np.repeat(sizes, sizes), np.repeat(loops.first[:-1], sizes)
    position = np.arange(len(steps)) - base
    total = steps.copy()
    for away in range(1, TREND + 1):
        share = 0.5 if away == TREND else 1.0
        total += share * (steps[base + (position + away) % size] + steps[base + (position - away) % size])
    return total
