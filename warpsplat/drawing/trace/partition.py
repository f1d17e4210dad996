"""The plane cut up into regions, whose boundaries are contours of shares.

The share of a colouring in a pixel is the area that it covers there. A sum of cubic B-splines, one for each
pixel, is found that is above a half on just this area of each pixel: where it is a half, there is the
boundary. So thin lines and small letters, which fill no pixel, have smooth outlines, too, and the colours of
a pixel get the areas that it shows (as in sub-pixel mapping: Atkinson 1997, "Mapping sub-pixel boundaries
from remotely sensed images").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, dilated, unchecked
from warpsplat.drawing.trace.label_map import LabelMap, label_components
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.regions import Regions
from warpsplat.drawing.trace.shares import Shares, beside_borders, find_shares
from warpsplat.scene.scene import numbers_in

FINEST = 4
"""Cells of the finest grid along a pixel."""

MOST_CELLS = 1 << 24
"""Cells at borders, if they are finer than the pixels, which bounds time and memory."""

MOST_DOUBT = 0.5
"""How far off boundaries may be on such a grid [cell]: what is finer shows noise."""

STEPS, RATE = 16, 0.3
"""Corrections of a sum of B-splines, and how much of the area that a pixel lacks is added to its coefficient:
more would not converge where lines are dense."""

REACH = 2
"""Pixels on each side of a pixel whose B-splines are not 0 there."""

GENTLEST = 0.7
"""Least slope of the sum at a boundary [1/px]: a gentler one tells little about the place of the boundary."""


@dataclass(frozen=True)
class Partition:
    """Connected regions on a grid of cells, of which one or several lie along a pixel."""

    labels: LabelMap
    """The region of each cell."""
    lead: Floats
    """How far the colouring of a cell is ahead of any other there, shape (block, scale, scale): 0 at a
    boundary; in pixels that are whole it is 1."""
    paint: Ints
    """The colouring of each region, shape (region,)."""
    colorings: list[Coloring]
    doubt: Floats
    """How far off the shares of pixels may be, and so the boundaries in them [px], shape (height, width)."""

    @property
    def scale(self) -> int:
        """Cells along a pixel."""
        return self.labels.scale

    @property
    def painted(self) -> LabelMap:
        """The colouring of each cell."""
        return self.labels.mapped(self.paint)


def find_partition(regions: Regions, check: Callable[[], None] = unchecked) -> Partition:
    """Return regions with boundaries between and within the pixels of their image.

    ``check``: as for ``trace``.
    """
    shares = find_shares(regions)
    at_border = beside_borders(shares.first) | (shares.share < 1)
    doubt = _usual(shares, at_border)
    # A border between pixels that are surely of one colouring each is exactly there.
    rows, columns = np.nonzero(dilated(at_border & ((shares.share < 1) | (shares.doubt > 0)), 3))
    finer = range(FINEST, 1, -1)
    scale = next((s for s in finer if s * s * len(rows) <= MOST_CELLS and s * doubt <= MOST_DOUBT), 1)
    painted, lead = _leading(shares, rows, columns, scale, check)
    check()
    labels, paint = label_components(LabelMap.cut(shares.first, rows, columns, painted))
    leads = np.ones(labels.blocks.shape, np.float32)
    leads[labels.block[rows + 1, columns + 1]] = lead
    return Partition(labels, leads, paint, regions.colorings, shares.doubt)


def _usual(shares: Shares, at_border: Bools) -> float:
    """Return the usual doubt of mixed pixels or, where borders are steps of pixels, of those beside them."""
    mixed = shares.share < 1
    some = shares.doubt[mixed if mixed.any() else at_border]
    return float(some.mean()) if len(some) else 0.0


def _leading(
    shares: Shares, rows: Ints, columns: Ints, scale: int, check: Callable[[], None]
) -> tuple[Ints, Floats]:
    """Return the colouring of each cell of some pixels, and how far it is ahead of the next one.

    Shape (pixel, scale, scale) each.
    """
    shape = len(rows), scale, scale
    painted = np.zeros(shape, np.int32)
    most, next_ = np.full(shape, -np.inf, np.float32), np.zeros(shape, np.float32)
    one, other = shares.first[rows, columns], shares.second[rows, columns]
    numbers = numbers_in(np.concatenate([one, other])).tolist()
    index = np.full(shares.share.shape, -1, np.intp)
    index[rows, columns] = np.arange(len(rows))
    for k in numbers:
        check()
        if len(numbers) == 2:  # one is where the other is not
            values = _level(shares.of(k, np.s_[:, :]), rows, columns, shares.doubt, scale)
            return np.where(values >= 0.5, *numbers), np.abs(2 * values - 1)
        own = (one == k) | (other == k)
        box = _around(rows[own], columns[own])
        share, number = shares.of(k, box), index[box]
        near_rows, near_columns = np.nonzero(dilated(share > 0, 3) & (number >= 0))
        some = number[near_rows, near_columns]
        values = _level(share, near_rows, near_columns, shares.doubt[box], scale)
        painted[some] = np.where(values > most[some], k, painted[some])
        next_[some] = np.maximum(next_[some], np.minimum(values, most[some]))
        most[some] = np.maximum(values, most[some])
    return painted, most - next_


def _around(rows: Ints, columns: Ints) -> tuple[slice, slice]:
    """Return the part of an image that some pixels are in, and those that their B-splines reach."""
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    margin = 2 * REACH
    return (
        slice(max(int(top) - margin, 0), int(bottom) + margin + 1),
        slice(max(int(left) - margin, 0), int(right) + margin + 1),
    )


def _level(share: Floats, rows: Ints, columns: Ints, doubt: Floats, scale: int) -> Floats:
    """Return a function at the cells of some pixels that is above a half on the share of each.

    Args:
        share: Shape (height, width).
        rows: Of the pixels, shape (pixel,).
        columns: Of the pixels, shape (pixel,).
        doubt: How far off each share may be, shape (height, width).
        scale: Cells along a pixel.

    Returns:
        Shape (pixel, scale, scale).
    """
    padded = np.pad(share, REACH, mode="edge")
    wide, coefficients = padded.shape[1], padded.reshape(-1)
    every = (rows + REACH) * wide + columns + REACH
    some, goal, slack = every, share[rows, columns], doubt[rows, columns]
    weights = _weights(max(scale, 2))
    for _ in range(STEPS):
        lack = goal - _covered(_sums(coefficients, wide, some, weights))
        lack -= np.clip(lack, -slack, slack)
        going = lack != 0
        some, goal, slack = some[going], goal[going], slack[going]
        coefficients[some] += RATE * lack[going]
        for side in (padded, padded[::-1], padded.T, padded.T[::-1]):
            for beyond in reversed(range(REACH)):  # what goes beyond the image goes straight on
                side[beyond] = 2 * side[beyond + 1] - side[beyond + 2]
    return np.moveaxis(_sums(coefficients, wide, every, _weights(scale)), 2, 0)


def _weights(scale: int) -> Floats:
    """Return the cubic B-splines of a pixel and its neighbours at its cells, along one side, (5, scale)."""
    away = np.abs(np.arange(-REACH, REACH + 1)[:, None] - (np.arange(scale) + 0.5) / scale + 0.5)
    rest = np.maximum(2 - away, 0)
    near, far = 2 / 3 - away * away * (1 - away / 2), rest * rest * rest / 6
    return np.where(away < 1, near, far).astype(np.float32)


def _sums(coefficients: Floats, wide: int, some: Ints, weights: Floats) -> Floats:
    """Return the sum of B-splines at the cells of some pixels, shape (scale, scale, pixel).

    ``coefficients``: of an image ``wide`` pixels in width, where ``some`` are; shape (all of its pixels,).
    """
    scale = weights.shape[1]
    total, across = np.zeros((scale, scale, len(some)), np.float32), np.empty((scale, len(some)), np.float32)
    for down in range(-REACH, REACH + 1):
        across[:] = 0
        for right in range(-REACH, REACH + 1):
            value = coefficients.take(some + (down * wide + right))
            for i in np.flatnonzero(weights[REACH + right]).tolist():
                across[i] += value * weights[REACH + right, i]
        for i in np.flatnonzero(weights[REACH + down]).tolist():
            total[i] += across * weights[REACH + down, i]
    return total


def _covered(values: Floats) -> Floats:
    """Return the share of each pixel where a function is above a half; shape (pixel,).

    ``values``: at its cells, shape (scale, scale, pixel); within a cell it is taken for linear.
    """
    down, right = np.gradient(values, axis=(0, 1))
    slope = np.maximum(np.abs(down) + np.abs(right), GENTLEST / len(values))
    return np.asarray(np.clip(0.5 + (values - 0.5) / slope, 0, 1).mean(axis=(0, 1)))
