"""The cover of regions, which hides parts of them, and the shortest paths under it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, eroded
from warpsplat.portable.elementary import hypot
from warpsplat.scene.scene import ranges

NEAREST, DEEPEST, DEPTH_STEP = 0.5, 16.0, 0.5
"""How far beyond its boundary what hides a region is measured: first, at the most, and between [px]."""

MARGIN = 0.7  # [px] between a hidden line and where it would be seen
SHORT = 1.5  # [px] of a line that needs no cover
LONG = 1e5  # [px] of all lines that are looked at together, which bounds the memory
CUT_OFF = 1.0  # [px squared] area of its region that a hidden outline may cut off


@dataclass(frozen=True)
class Cover:
    """The opaque regions, by their rank in the order of painting."""

    ranks: Ints
    """Rank of what is painted at each pixel, -1 where that hides nothing; shape (height, width)."""

    @cached_property
    def _framed(self) -> Ints:
        """The ranks with a frame of pixels that hide all, shape (height + 2, width + 2)."""
        return np.pad(self.ranks, 1, constant_values=np.iinfo(self.ranks.dtype).max)

    def hides(self, rank: Ints, points: Floats) -> Bools:
        """Return whether regions of these ranks are hidden at points, shape (point, 2); outside, all are."""
        x, y = (
            np.minimum(np.maximum(np.floor(places).astype(np.intp), -1), size) + 1
            for places, size in zip(points.T, self.ranks.shape[::-1], strict=True)
        )
        return np.asarray(self._framed[y, x] > rank)

    def hides_lines(self, rank: Ints, start: Floats, end: Floats) -> Bools:
        """Return whether straight lines with a margin are hidden, their ends aside; shape (line,)."""
        vector = end - start
        size = hypot(*vector.T)
        half = len(size) // 2
        if half and size.sum() > LONG:
            parts = (slice(None, half), slice(half, None))
            return np.concatenate([self.hides_lines(rank[part], start[part], end[part]) for part in parts])
        hidden = size < SHORT
        lines = np.flatnonzero(~hidden)
        unit = vector[lines] / size[lines, None]
        counts = np.ceil((size[lines] - 1.25) / 0.5).astype(np.intp)
        line, number = np.repeat(np.arange(len(lines)), counts), ranges(np.zeros_like(counts), counts)
        points = start[lines][line] + (0.75 + 0.5 * number)[:, None] * unit[line]
        normal = MARGIN * np.stack([-unit[:, 1], unit[:, 0]], axis=1)[line]
        ranks = rank[lines][line]
        is_inner = (number > 0) & (number < counts[line] - 1)
        inner = np.flatnonzero(is_inner)
        places = np.concatenate([points, points[inner] + normal[inner], points[inner] - normal[inner]])
        seen = ~self.hides(np.concatenate([ranks, ranks[inner], ranks[inner]]), places)
        hidden[lines] = np.bincount(np.concatenate([line, line[inner], line[inner]]), seen, len(lines)) == 0
        return hidden

    def hides_polygon(self, rank: int, polygon: Floats) -> bool:
        """Return whether no region up to a rank is seen in a polygon, pixels on its edge aside."""
        left, top = low = np.floor(polygon.min(axis=0)).astype(np.intp)
        right, bottom = np.ceil(polygon.max(axis=0)).astype(np.intp) + 1
        mask = np.zeros((bottom - top, right - left), np.uint8)
        cv2.fillPoly(mask, [np.round(polygon - low - 0.5).astype(np.int32)], 1)
        seen = self.ranks[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)] <= rank
        inside = eroded(mask, 3)[max(-top, 0) :, max(-left, 0) :][: seen.shape[0], : seen.shape[1]]
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
        for depth in np.arange(NEAREST, DEEPEST, DEPTH_STEP):
            open_ = open_[self.hides(rank[open_], middle[open_] + depth * outward[open_])]
            reach[open_] = depth
        near = middle + NEAREST * np.stack([steps[:, 1], -steps[:, 0]], axis=1)
        return np.where(reach[:, None] > NEAREST, middle + 0.5 * reach[:, None] * outward, near)


@dataclass(frozen=True)
class HiddenPaths:
    """The shortest paths under a cover, found for all at once."""

    cover: Cover
    rank: Ints
    """Rank of the region that each path is hidden from, shape (path,)."""
    has_holes: bool
    """Whether what is above may have holes, through which a path must not be seen."""
    first: Ints
    """First goal of each path and, last, the number of goals, shape (path + 1,)."""
    goals: Floats
    """Ends of paths and, beyond each crack between, a hidden point; shape (goal, 2)."""
    vertices: Floats
    """The region's boundary, a vertex before each crack, and the last one three times; shape (goal, 2)."""

    def corners(self) -> list[Floats]:
        """Return the corners of each path between its first and its last goal, shape (corner, 2)."""
        cross = self.vertices[:-1, 0] * self.vertices[1:, 1] - self.vertices[1:, 0] * self.vertices[:-1, 1]
        swept = np.concatenate([[0.0], np.cumsum(cross)])
        path, at, last = np.arange(len(self.rank)), self.first[:-1].copy(), self.first[1:] - 1
        is_corner = np.zeros(len(self.goals), np.bool_)
        while len(path):
            at = self._furthest(swept, path, at, last[path])
            is_corner[at] = True
            going = at < last[path]
            path, at = path[going], at[going]
        is_corner[last] = False
        parts = np.split(
            np.flatnonzero(is_corner), np.searchsorted(np.flatnonzero(is_corner), self.first[1:-1])
        )
        return [self.goals[part] for part in parts]

    def _furthest(self, swept: Floats, path: Ints, at: Ints, last: Ints) -> Ints:
        """Return the last goals reached from goals ``at`` in straight lines, by a galloping search."""
        best = np.where(self._are_free(swept, path, at, last), last, at + 1)
        high = best.copy()  # not reached, where it is more than the best one
        open_, step = np.flatnonzero(best < last), 1
        while len(open_):
            goal = at[open_] + step
            in_reach = goal < last[open_]
            high[open_[~in_reach]] = last[open_[~in_reach]]
            open_, goal = open_[in_reach], goal[in_reach]
            free = self._are_free(swept, path[open_], at[open_], goal)
            best[open_[free]] = goal[free]
            high[open_[~free]] = goal[~free]
            open_, step = open_[free], 2 * step
        open_ = np.flatnonzero(high - best > 1)
        while len(open_):
            middle = (best[open_] + high[open_]) // 2
            free = self._are_free(swept, path[open_], at[open_], middle)
            best[open_[free]], high[open_[~free]] = middle[free], middle[~free]
            open_ = open_[high[open_] - best[open_] > 1]
        return best

    def _are_free(self, swept: Floats, path: Ints, i: Ints, j: Ints) -> Bools:
        """Return whether paths may go straight from goals i to goals j."""
        # Cutting short must not cut off the region itself, which lies on the right.
        corners = self.vertices[j], self.goals[j], self.goals[i], self.vertices[i]
        beside = swept[j] - swept[i]
        for a, b in itertools.pairwise(corners):
            beside = beside + a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        free = beside <= 2 * CUT_OFF
        kept = np.flatnonzero(free)
        free[kept] = self.cover.hides_lines(self.rank[path[kept]], self.goals[i[kept]], self.goals[j[kept]])
        # Nothing lower may be covered; and nothing of the region itself be missing beside a hole.
        below = self.rank[path] - (0 if self.has_holes else 1)
        for number in np.flatnonzero(free).tolist():
            low, high = int(i[number]), int(j[number])
            polygon = np.concatenate([self.vertices[low : high + 1], self.goals[[high, low]]])
            free[number] = self.cover.hides_polygon(int(below[number]), polygon)
        return free
