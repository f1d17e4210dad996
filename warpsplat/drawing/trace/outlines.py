"""Sub-pixel outlines: where in the antialiased pixels beside a crack the boundary lies.

In a column of pixels that a boundary crosses from left to right, the sum of what is covered is the boundary's
mean height in the column: for a straight one, its height in the middle of the column, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints
from warpsplat.drawing.trace.planar import INSIDE, LEFT, OUTSIDE, RIGHT, STEPS, Loops
from warpsplat.drawing.trace.regions import Regions

REACH = 3  # [px] how far from a crack mixed pixels count
PURE = 0.02  # share of the other region up to which a pixel is not mixed
FOREIGN = (
    20.0  # [levels] distance of a pixel from any mixture of the two, from which on it has a third colour
)
SOFT = 6  # cracks ahead and behind whose mean is a point between two steps of smooth shading
TREND = 3  # cracks ahead and behind that tell the direction of an outline


@dataclass(frozen=True)
class Boundary:
    """The boundary of regions at each crack."""

    points: Floats
    """The sub-pixel place, shape (crack, 2)."""
    is_good: Bools
    """Which of them to use: horizontal cracks of flat parts of an outline, vertical ones of steep parts."""
    offsets: Floats
    """How far the boundary lies to the left of each crack [px], shape (crack,)."""
    trends: Floats
    """Direction of the outline, not normalised, shape (crack, 2)."""


def find_boundary(loops: Loops, regions: Regions) -> Boundary:
    """Measure where the boundary lies at each crack."""
    steps, trends = STEPS[loops.directions], _trends(loops)
    normal = np.stack([steps[:, 1], -steps[:, 0]], axis=1)  # to the left, as y points down
    offsets = _offsets(loops, regions)
    points = loops.vertices + 0.5 * steps + offsets[:, None] * normal
    is_band = np.array([coloring.is_band for coloring in regions.colorings])[regions.paint]
    mine = np.repeat(loops.region, np.diff(loops.first))
    soft = (loops.others != NO_REGION) & (mine != NO_REGION) & is_band[mine] & is_band[loops.others]
    if soft.any():
        smooth = _around(loops, loops.vertices + 0.5 * steps, SOFT) / (2 * SOFT)
        points = np.where(soft[:, None], smooth, points)
    x, y = np.abs(trends).T
    is_level = (loops.directions == RIGHT) | (loops.directions == LEFT)
    return Boundary(points, np.where(is_level, x >= y, y > x), offsets, trends)


def _offsets(loops: Loops, regions: Regions) -> Floats:
    """Return how far the boundary lies to the left of each crack [px], shape (crack,)."""
    inner, outer = loops.vertices + INSIDE[loops.directions], loops.vertices + OUTSIDE[loops.directions]
    height, width = regions.labels.shape
    real = (loops.others != NO_REGION) & ((inner >= 0) & (inner < [width, height])).all(axis=1)
    offsets = np.zeros(len(inner))
    inner, outer = inner[real], outer[real]
    mine, theirs = regions.fills[inner[:, 1], inner[:, 0]], regions.fills[outer[:, 1], outer[:, 0]]
    found = _intrusion(regions, outer, outer - inner, mine, theirs)
    found -= _intrusion(regions, inner, inner - outer, theirs, mine)
    offsets[real] = found
    return offsets


def _intrusion(regions: Regions, start: Ints, step: Ints, mine: Floats, theirs: Floats) -> Floats:
    """Return how far the colours ``mine`` reach into the other region, from ``start`` on [px]."""
    height, width = regions.labels.shape
    # Channel by channel: sums along an axis of four take ten times as long.
    theirs, between = np.ascontiguousarray(theirs.T), np.ascontiguousarray((mine - theirs).T)
    square = np.maximum((between.astype(np.float64) ** 2).sum(axis=0), 1e-6)
    label = regions.labels[start[:, 1], start[:, 0]]
    total, before, going = np.zeros(len(start)), np.ones(len(start)), np.arange(len(start))
    for reach in range(REACH):
        x, y = (start[going] + reach * step[going]).T
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        going, x, y = going[inside], x[inside], y[inside]
        away, toward = regions.image[y, x].T - theirs[:, going], between[:, going]
        share = np.clip((away * toward).sum(axis=0) / square[going], 0, 1)
        off = np.abs(away - share * toward).max(axis=0)
        mixed = (share <= before[going] + PURE) & (share > PURE) & (off < FOREIGN)
        mixed &= regions.labels[y, x] == label[going]
        going = going[mixed]
        total[going] += share[mixed]
        before[going] = share[mixed]
    return total


def _trends(loops: Loops) -> Floats:
    """Return the direction of the outline at each crack, from those near it; shape (crack, 2)."""
    return _around(loops, STEPS[loops.directions].astype(np.float64), TREND)


def _around(loops: Loops, values: Floats, reach: int) -> Floats:
    """Return the sums of ``values`` at the cracks, over those up to ``reach`` ahead and behind.

    The outermost count half: on a diagonal, horizontal and vertical ones are then as many.
    """
    sizes = np.diff(loops.first)
    size, base = np.repeat(sizes, sizes), np.repeat(loops.first[:-1], sizes)
    position = np.arange(len(values)) - base
    total = values.copy()
    for away in range(1, reach + 1):
        share = 0.5 if away == reach else 1.0
        total += share * (values[base + (position + away) % size] + values[base + (position - away) % size])
    return np.asarray(total)
