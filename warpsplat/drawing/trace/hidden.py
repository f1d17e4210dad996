"""The cover of regions, which hides parts of them, and the shortest paths under it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, eroded
from warpsplat.drawing.trace.label_map import LabelMap
from warpsplat.portable.elementary import hypot
from warpsplat.scene.simple import area

NEAREST, DEEPEST = 0.5, 16.0
"""How far beyond its boundary what hides a region is measured: first, which is the step as well, and at the
most [cell]."""

MARGIN = 0.7  # [cell] between a hidden line and where it would be seen

HIDES_ALL = int(np.iinfo(np.int64).max)
"""Rank of what is outside an image."""


@dataclass(frozen=True)
class Cover:
    """The opaque regions, by their rank in the order of painting."""

    ranks: LabelMap
    """Rank of what is painted at each cell, -1 where that hides nothing; outside, ``HIDES_ALL``."""

    def hides(self, rank: Ints | int, points: Floats) -> Bools:
        """Return whether regions of these ranks are hidden at points, shape (point, 2); outside, all are."""
        x, y = (
            np.minimum(np.maximum(np.floor(places).astype(np.intp), -1), size)
            for places, size in zip(points.T, self.ranks.shape[::-1], strict=True)
        )
        return np.asarray(self.ranks.at(y, x) > rank)

    def hides_line(self, rank: int, start: Floats, end: Floats) -> bool:
        """Return whether a straight line with a margin is hidden, its ends aside."""
        size = float(hypot(*(end - start)))
        unit = (end - start) / max(size, 1e-9)
        points = start + np.arange(0.75, size - 0.5, 0.5)[:, None] * unit
        aside = MARGIN * np.array([-unit[1], unit[0]])
        places = np.concatenate([points, points[1:-1] + aside, points[1:-1] - aside])
        return bool(self.hides(rank, places).all())

    def hides_polygon(self, rank: int, polygon: Floats) -> bool:
        """Return whether no region up to a rank is seen in a polygon, pixels on its edge aside."""
        left, top = low = np.floor(polygon.min(axis=0)).astype(np.intp)
        right, bottom = np.ceil(polygon.max(axis=0)).astype(np.intp) + 1
        mask = np.zeros((bottom - top, right - left), np.uint8)
        cv2.fillPoly(mask, [np.round(polygon - low - 0.5).astype(np.int32)], 1)
        height, width = self.ranks.shape
        box = max(top, 0), max(left, 0), min(bottom, height), min(right, width)
        seen = self.ranks.window(*box) <= rank
        inside = eroded(mask, 3)[box[0] - top : box[2] - top, box[1] - left : box[3] - left]
        return not (inside & seen).any()

    def middles(self, rank: Ints, begins: Ints, steps: Ints, trends: Floats) -> Floats:
        """Return points beyond cracks, halfway through what hides a region there, shape (crack, 2).

        Args:
            rank: Of the regions, shape (crack,).
            begins: Where the cracks begin, shape (crack, 2).
            steps: Their directions, shape (crack, 2).
            trends: Directions of the outline, shape (crack, 2).
        """
        # Around a single pixel there may be no trend.
        trends = np.where(np.abs(trends).max(axis=1, keepdims=True) > 0, trends, steps)
        outward = np.stack([trends[:, 1], -trends[:, 0]], axis=1) / hypot(*trends.T)[:, None]
        middle = begins + 0.5 * steps
        reach, open_ = np.full(len(begins), NEAREST), np.arange(len(begins))
        for depth in np.arange(NEAREST, DEEPEST, NEAREST):
            open_ = open_[self.hides(rank[open_], middle[open_] + depth * outward[open_])]
            reach[open_] = depth
        near = middle + NEAREST * np.stack([steps[:, 1], -steps[:, 0]], axis=1)
        return np.where(reach[:, None] > NEAREST, middle + 0.5 * reach[:, None] * outward, near)


def hidden_path(cover: Cover, rank: int, has_holes: bool, goals: Floats, vertices: Floats) -> Floats:
    """Return the corners of about the shortest path under a cover, without its ends, shape (corner, 2).

    Args:
        cover: Over the regions.
        rank: Of the region that the path bounds.
        has_holes: Whether what is above may have holes, through which the path must not be seen.
        goals: Both ends and, beyond each crack between, a hidden point, shape (goal, 2).
        vertices: The region's boundary, a vertex before each crack, and the last one three times, (goal, 2).
    """
    # Nothing lower may be covered; and nothing of the region itself be missing beside a hole.
    below = rank if has_holes else rank - 1

    def is_free(low: int, high: int) -> bool:
        polygon = np.concatenate([vertices[low : high + 1], goals[[high, low]]])
        # The region is to the right of its boundary: a path on that side would leave a part of it out.
        if area(polygon) > 1:
            return False
        return cover.hides_line(rank, goals[low], goals[high]) and cover.hides_polygon(below, polygon)

    last, corners = len(goals) - 1, [0]
    while corners[-1] < last:
        at = corners[-1]
        best, high = last if is_free(at, last) else at + 1, last
        while high - best > 1:
            middle = (best + high) // 2
            best, high = (middle, high) if is_free(at, middle) else (best, middle)
        corners.append(best)
    return goals[corners[1:-1]]
