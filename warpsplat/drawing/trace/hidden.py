"""The cover of a region, which hides parts of it, and the shortest paths under it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, eroded
from warpsplat.portable.elementary import hypot

NEAREST, DEEPEST, DEPTH_STEP = 0.5, 16.0, 0.5
"""How far beyond its boundary what hides a region is measured: first, at the most, and between [px]."""

MARGIN = 0.7  # [px] between a hidden line and where it would be seen
CUT_OFF = 1.0  # [px squared] area of its region that a hidden outline may cut off


@dataclass(frozen=True)
class Cover:
    """The opaque regions, by their rank in the order of painting."""

    ranks: Ints
    """Rank of what is painted at each pixel, -1 where that hides nothing; shape (height, width)."""

    def hides(self, rank: int, points: Floats) -> Bools:
        """Return whether a region of this rank is hidden at points, shape (point, 2); outside, all is."""
        height, width = self.ranks.shape
        cell = np.floor(points).astype(np.intp)
        outside = ((cell < 0) | (cell >= [width, height])).any(axis=1)
        return outside | (
            self.ranks[np.clip(cell[:, 1], 0, height - 1), np.clip(cell[:, 0], 0, width - 1)] > rank
        )

    def hides_line(self, rank: int, start: Floats, end: Floats) -> bool:
        """Return whether a straight line with a margin is hidden, its ends aside."""
        vector = end - start
        size = float(hypot(*vector))
        if size < 1.5:
            return True
        unit = vector / size
        normal = MARGIN * np.array([-unit[1], unit[0]])
        points = start + np.arange(0.75, size - 0.5, 0.5)[:, None] * unit
        beside = [points, points[1:-1] + normal, points[1:-1] - normal]
        return bool(self.hides(rank, np.concatenate(beside)).all())

    def hides_polygon(self, rank: int, polygon: Floats) -> bool:
        """Return whether all of a polygon is hidden, pixels on its edge aside."""
        low = np.floor(polygon.min(axis=0)).astype(np.intp)
        width, height = np.ceil(polygon.max(axis=0)).astype(np.intp) - low + 1
        mask = np.zeros((height, width), np.uint8)
        cv2.fillPoly(mask, [np.round(polygon - low - 0.5).astype(np.int32)], 1)
        rows, columns = np.nonzero(eroded(mask, 3))
        return bool(self.hides(rank, np.stack([columns, rows], axis=1) + low + 0.5).all())

    def middles(self, rank: int, begins: Ints, steps: Ints, trends: Floats) -> Floats:
        """Return points beyond cracks, halfway through what hides a region there, shape (crack, 2).

        Args:
            rank: Of the region.
            begins: Where the cracks begin, shape (crack, 2).
            steps: Their directions, shape (crack, 2).
            trends: Directions of the outline, shape (crack, 2).
        """
        # Around a single pixel there may be no trend.
        trends = np.where(np.abs(trends).max(axis=1, keepdims=True) > 0, trends, steps)
        outward = np.stack([trends[:, 1], -trends[:, 0]], axis=1) / hypot(*trends.T)[:, None]
        middle = begins + 0.5 * steps
        reach, is_hidden = np.full(len(begins), NEAREST), np.ones(len(begins), np.bool_)
        for depth in np.arange(NEAREST, DEEPEST, DEPTH_STEP):
            is_hidden &= self.hides(rank, middle + depth * outward)
            reach[is_hidden] = depth
        near = middle + NEAREST * np.stack([steps[:, 1], -steps[:, 0]], axis=1)
        return np.where(reach[:, None] > NEAREST, middle + 0.5 * reach[:, None] * outward, near)


def shortest_path(cover: Cover, rank: int, goals: Floats, vertices: Floats, *, through_holes: bool) -> Floats:
    """Return the corners of a path from the first to the last goal, hidden from a region of this rank.

    Args:
        cover: What hides the region.
        rank: Of the region.
        goals: Its ends and, beyond each crack between, a hidden point; shape (crack + 2, 2).
        vertices: Of the region's boundary, one more than there are cracks, the last one twice; shape
            (crack + 2, 2).
        through_holes: Whether what is above has holes, through which the path must not be seen.
    """
    cross = vertices[:-1, 0] * vertices[1:, 1] - vertices[:-1, 1] * vertices[1:, 0]
    swept = np.concatenate([[0.0], np.cumsum(cross)])

    def is_free(i: int, j: int) -> bool:
        """Return whether the path may go straight from goal i to goal j."""
        # Cutting short must not cut off the region itself, which lies on the right.
        corners = vertices[j], goals[j], goals[i], vertices[i]
        beside = swept[j] - swept[i] + sum(a[0] * b[1] - a[1] * b[0] for a, b in itertools.pairwise(corners))
        if beside > 2 * CUT_OFF or not cover.hides_line(rank, goals[i], goals[j]):
            return False
        if not through_holes:
            return True
        return cover.hides_polygon(rank, np.concatenate([vertices[i : j + 1], goals[[j, i]]]))

    at, found = 0, []
    while at < len(goals) - 1:
        at = _furthest(is_free, at, len(goals) - 1)
        found.append(goals[at])
    return np.asarray(found[:-1]).reshape(-1, 2)


def _furthest(is_free: Callable[[int, int], bool], at: int, last: int) -> int:
    """Return the last goal after ``at`` that is reached in a straight line, found by a galloping search."""
    if is_free(at, last):
        return last
    reach, best = 1, at + 1
    while at + reach < last and is_free(at, at + reach):
        best = at + reach
        reach *= 2
    low, high = best, min(at + reach, last)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if is_free(at, middle) else (low, middle)
    return low
