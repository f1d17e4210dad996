"""Regions as shapes that lie on one another: each boundary is drawn by the upper of its two regions only, and
the lower one goes on under it, the shortest way.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.trace.curves import Pieces, Run, straight
from warpsplat.drawing.trace.grids import NOBODY, Bools, Floats, Ints
from warpsplat.drawing.trace.order import Layers
from warpsplat.drawing.trace.planar import STEPS, Loops
from warpsplat.portable.elementary import cos, hypot, sin
from warpsplat.portable.linear import principal_direction

SEEN, EDGE, HIDDEN = range(3)
"""What lies across a crack: something lower, nothing (the picture's edge), something higher."""

UNDER = 1.0
"""How far an outline goes on under the region above it before it turns [px]."""

NEAR, DEEP = 0.5, 16.0
"""How far beyond its boundary a hidden outline is looked for, half as far it goes [px]."""

ASIDE = 1.0
"""Area of the region that a hidden outline may cut off [px squared]."""

MARGIN = 0.7
"""What a hidden outline keeps from where it would be seen [px]."""

_ANGLES = np.linspace(0, 2 * np.pi, 12, endpoint=False)
CIRCLE = np.stack([cos(_ANGLES), sin(_ANGLES)], axis=1)
"""Points on the unit circle, shape (12, 2)."""

DOT = 8
"""Cracks of the largest loop that is a dot, whose shape cannot be told."""

STRAIGHT = 0.05
"""How far the joint of two lines may be from their common straight way [px]."""

STILL = 0.02
"""Offset below which a crack is where the pixels say [px]."""


Stretch = tuple[int, Ints]
"""What lies across some cracks in a row, and the cracks."""


@dataclass(frozen=True)
class Outline:
    """A contour before its curves are fitted: runs by number, corners on the way from each to the next."""

    parts: list[int | Floats]


@dataclass
class Tracer:
    """What the runs of outlines are made of."""

    loops: Loops
    labels: Ints
    layers: Layers
    see_through: Bools
    """Regions under which nothing may lie, shape (region,)."""
    holed: Bools
    """Regions that have something of these in them, shape (region,)."""
    points: Floats
    """Sub-pixel places of the cracks, shape (crack, 2)."""
    good: Bools
    """Which of them to use, shape (crack,)."""
    offsets: Floats
    """Of the cracks [px]."""
    trend: Floats
    """Direction of the outline at the cracks, shape (crack, 2)."""
    runs: list[Run]
    """What was found so far."""

    def outlines(self, loop: int) -> list[Outline]:
        """The contour of a loop; none where it is hidden altogether."""
        low, high = int(self.loops.first[loop]), int(self.loops.first[loop + 1])
        region = int(self.loops.region[loop])
        others = self.loops.others[low:high]
        kinds = self._kinds(region, others)
        if (kinds == HIDDEN).all():
            if self.loops.is_hole[loop] and not self.holed[others].any():
                return []
            if self.loops.is_hole[loop]:
                return [self._under(region, low, high)]
            kinds[:] = SEEN
        if (kinds == kinds[0]).all():
            if kinds[0] == SEEN:
                return [self._ring(low, high)]
            return [Outline([self._corners(low, high, closed=True)])]
        turn = int(np.flatnonzero(kinds != np.roll(kinds, 1))[0])
        cracks = low + (np.arange(high - low) + turn) % (high - low)
        kinds = np.roll(kinds, -turn)
        bounds = [*np.flatnonzero(np.diff(kinds, prepend=-1)).tolist(), len(kinds)]
        stretches: list[Stretch] = [(int(kinds[a]), cracks[a:b]) for a, b in itertools.pairwise(bounds)]
        return [self._chain(region, stretches)]

    def _kinds(self, region: int, others: Ints) -> Ints:
        rank = self.layers.rank
        known = np.maximum(others, 0)
        higher = (rank[known] > rank[region]) & ~self.see_through[known]
        kinds = np.where(higher, HIDDEN, SEEN)
        return np.where(others == NOBODY, EDGE, kinds)

    def _ring(self, low: int, high: int) -> Outline:
        """A loop that is seen all around."""
        cracks = np.arange(low, high)
        if high - low <= DOT and np.abs(self.offsets[low:high]).max() > STILL:
            return self._dot(low, high)
        if self._is_pixel_exact(cracks):
            return Outline([self._corners(low, high, closed=True)])
        points = self._points(cracks, closed=True)
        self.runs.append(Run(points, closed=True))
        return Outline([len(self.runs) - 1])

    def _under(self, region: int, low: int, high: int) -> Outline:
        """A hole that must be left open, a little smaller than what lies over it."""
        cracks = np.arange(low, high)
        middles = self._middles(region, cracks)
        kept = self._points(cracks, closed=True, of=0.5 * (self.points[cracks] + middles))
        self.runs.append(Run(kept, closed=True))
        return Outline([len(self.runs) - 1])

    def _dot(self, low: int, high: int) -> Outline:
        """A circle of the loop's area about its middle."""
        vertices = self.loops.vertices[low:high].astype(np.float64)
        following = np.roll(vertices, -1, axis=0)
        area = float((vertices[:, 0] * following[:, 1] - following[:, 0] * vertices[:, 1]).sum()) / 2
        full = area + float(self.offsets[low:high].sum())
        radius = np.sqrt(max(abs(full), 0.1) / np.pi)
        middle = self.points[low:high].mean(axis=0)
        circle = middle + radius * CIRCLE * (1, np.sign(area))
        self.runs.append(Run(circle, closed=True))
        return Outline([len(self.runs) - 1])

    def _is_pixel_exact(self, cracks: Ints) -> bool:
        """Whether a stretch is where the pixels say and has few corners."""
        if np.abs(self.offsets[cracks]).max() > STILL:
            return False
        turns = int((np.diff(self.loops.ways[cracks]) != 0).sum())
        return turns <= 4 + len(cracks) / 40

    def _corners(self, low: int, high: int, *, closed: bool) -> Floats:
        """Vertices where the cracks turn."""
        ways = self.loops.ways[low:high]
        turned = ways != np.roll(ways, 1)
        if not closed:
            turned[0] = True
        return self.loops.vertices[low:high][turned].astype(np.float64)

    def _points(self, cracks: Ints, *, closed: bool, of: Floats | None = None) -> Floats:
        """The good points of a stretch, or those of others in their place, without those where three regions
        meet.
        """
        places = self.points[cracks] if of is None else of
        others = self.loops.others[cracks]
        change = others != np.roll(others, 1)
        if not closed:
            change[0] = False
        mixed = change | np.roll(change, -1)
        good = self.good[cracks]
        clean = good & ~mixed
        keep = clean if clean.sum() >= max(4, 0.5 * good.sum()) else good
        return places[keep] if keep.any() else places

    def _chain(self, region: int, stretches: list[Stretch]) -> Outline:
        """A loop that is seen in parts."""
        ends: list[tuple[Floats, Floats]] = []
        count = len(stretches)
        for number, (kind, cracks) in enumerate(stretches):
            first = self.loops.vertices[cracks[0]].astype(np.float64)
            last = self.loops.vertices[cracks[-1]] + STEPS[self.loops.ways[cracks[-1]]].astype(np.float64)
            if kind == SEEN:
                points = self._points(cracks, closed=False)
                before, after = stretches[number - 1][0], stretches[(number + 1) % count][0]
                first = self._end(region, points[::-1], first, before)
                last = self._end(region, points, last, after)
            ends.append((first, last))
        parts: list[int | Floats] = []
        for number, (kind, cracks) in enumerate(stretches):
            start, end = ends[number]
            if kind == SEEN:
                parts.append(self._seen(cracks, start, end))
            elif kind == EDGE:
                parts.append(self._along_edge(cracks, stretches, number))
            else:
                start, end = ends[number - 1][1], ends[(number + 1) % count][0]
                parts.append(self._hidden(region, cracks, start, end))
        return Outline(parts)

    def _seen(self, cracks: Ints, start: Floats, end: Floats) -> int:
        if self._is_pixel_exact(cracks):
            ways = self.loops.ways[cracks]
            inner = self.loops.vertices[cracks[1:]][ways[1:] != ways[:-1]].astype(np.float64)
            self.runs.append(Run(np.concatenate([start[None], inner, end[None]]), False, is_polygon=True))
        else:
            self.runs.append(Run(self._points(cracks, closed=False), False, start, end))
        return len(self.runs) - 1

    def _along_edge(self, cracks: Ints, stretches: list[Stretch], number: int) -> Floats:
        """The picture's corners on the way, and where a hidden stretch begins or ends."""
        vertices, ways = self.loops.vertices, self.loops.ways[cracks]
        points = vertices[cracks[1:]][ways[1:] != ways[:-1]].astype(np.float64)
        if stretches[number - 1][0] == HIDDEN:
            points = np.concatenate([vertices[cracks[:1]], points])
        if stretches[(number + 1) % len(stretches)][0] == HIDDEN:
            points = np.concatenate([points, vertices[cracks[-1:]] + STEPS[ways[-1:]]])
        return points

    def _end(self, region: int, points: Floats, vertex: Floats, kind: int) -> Floats:
        """Where a stretch of ``points`` ends beside ``vertex``, before one of ``kind``."""
        tail = points[-5:]
        if len(tail) < 2:
            return vertex
        middle = tail.mean(axis=0)
        way = principal_direction(tail)
        way = way if (way * (tail[-1] - tail[0])).sum() > 0 else -way
        height, width = self.labels.shape
        if kind == EDGE:
            axis = 0 if vertex[0] in (0, width) else 1
            if abs(way[axis]) < 0.3:
                return vertex
            reached = middle + way * (vertex[axis] - middle[axis]) / way[axis]
            reached[axis] = vertex[axis]
            reached[1 - axis] = np.clip(reached[1 - axis], 0, (height, width)[axis])
            return reached if hypot(*(reached - vertex)) < 1.5 else vertex
        ahead, behind = ((place - middle) * way for place in (vertex, tail[-1]))
        reached = middle + way * max(float(ahead.sum()), float(behind.sum()) + 0.1)
        if hypot(*(reached - vertex)) > 1.0:
            reached = vertex
        further = reached + UNDER * way
        return further if self._covered(region, further[None])[0] else reached

    def _covered(self, region: int, points: Floats) -> Bools:
        """Whether what is at points lies above the region."""
        height, width = self.labels.shape
        cell = np.floor(points).astype(np.intp)
        outside = ((cell < 0) | (cell >= [width, height])).any(axis=1)
        label = self.labels[np.clip(cell[:, 1], 0, height - 1), np.clip(cell[:, 0], 0, width - 1)]
        above = (self.layers.rank[label] > self.layers.rank[region]) & ~self.see_through[label]
        return np.asarray(outside | above)

    def _hidden(self, region: int, cracks: Ints, start: Floats, end: Floats) -> Floats:
        """Corners of a way from ``start`` to ``end`` under what lies above the region."""
        holed = bool(self.holed[self.loops.others[cracks]].any())
        goals = np.concatenate([start[None], self._middles(region, cracks), end[None]])
        vertices = self.loops.vertices[np.append(cracks, cracks[-1])].astype(np.float64)
        ahead = np.concatenate([vertices, vertices[-1:]])
        swept = np.cumsum(vertices[:, 0] * ahead[1:, 1] - vertices[:, 1] * ahead[1:, 0])
        swept = np.concatenate([[0.0], swept])

        def is_free(i: int, j: int) -> bool:
            # Cutting short must not cut off the region itself, which lies on the right.
            way = ahead[j], goals[j], goals[i], ahead[i]
            beside = swept[j] - swept[i] + sum(a[0] * b[1] - a[1] * b[0] for a, b in itertools.pairwise(way))
            if beside > 2 * ASIDE or not self._is_free(region, goals[i], goals[j]):
                return False
            return not holed or self._is_filled(region, np.concatenate([ahead[i : j + 1], goals[[j, i]]]))

        at, found = 0, []
        while at < len(goals) - 1:
            at = _furthest(is_free, at, len(goals) - 1)
            found.append(goals[at])
        return np.asarray(found[:-1]).reshape(-1, 2)

    def _middles(self, region: int, cracks: Ints) -> Floats:
        """Points beyond cracks, halfway through what lies above the region there, shape (crack, 2)."""
        steps = STEPS[self.loops.ways[cracks]]
        trend = self.trend[cracks]
        # Around a single pixel there may be none.
        trend = np.where(np.abs(trend).max(axis=1, keepdims=True) > 0, trend, steps)
        outward = np.stack([trend[:, 1], -trend[:, 0]], axis=1) / hypot(*trend.T)[:, None]
        middle = self.loops.vertices[cracks] + 0.5 * steps
        reach, open_ = np.full(len(cracks), NEAR), np.ones(len(cracks), np.bool_)
        for depth in np.arange(NEAR, DEEP, 0.5):
            open_ &= self._covered(region, middle + depth * outward)
            reach[open_] = depth
        straight_out = np.stack([steps[:, 1], -steps[:, 0]], axis=1)
        near = middle + NEAR * straight_out
        return np.where(reach[:, None] > NEAR, middle + 0.5 * reach[:, None] * outward, near)

    def _is_filled(self, region: int, polygon: Floats) -> bool:
        """Whether all of a polygon is hidden from the region; pixels on its edge may be the region's."""
        low = np.floor(polygon.min(axis=0)).astype(np.intp)
        width, height = np.ceil(polygon.max(axis=0)).astype(np.intp) - low + 1
        mask = np.zeros((height, width), np.uint8)
        cv2.fillPoly(mask, [np.round(polygon - low - 0.5).astype(np.int32)], 1)
        rows, columns = np.nonzero(cv2.erode(mask, np.ones((3, 3), np.uint8)))
        inside = np.stack([columns, rows], axis=1) + low + 0.5
        return bool(self._covered(region, inside).all())

    def _is_free(self, region: int, start: Floats, end: Floats) -> bool:
        """Whether a straight line is hidden, its ends aside."""
        way = end - start
        size = float(hypot(*way))
        if size < 1.5:
            return True
        unit = way / size
        normal = MARGIN * np.array([-unit[1], unit[0]])
        along = np.arange(0.75, size - 0.5, 0.5)[:, None]
        points = start + along * unit
        return bool(
            self._covered(region, points).all()
            and self._covered(region, points[1:-1] + normal).all()
            and self._covered(region, points[1:-1] - normal).all()
        )


def _furthest(is_free: Callable[[int, int], bool], at: int, last: int) -> int:
    """The last of some places after ``at`` that is reached in a straight line, found in growing steps."""
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


def assembled(outline: Outline, fitted: list[Pieces]) -> Pieces | None:
    """The contour's cubics, with lines from each run over the corners to the next."""
    cubics: list[Floats] = []
    lines: list[bool] = []
    whole = [part for part in outline.parts if isinstance(part, int) or len(part)]
    if not whole:
        return None
    for number, part in enumerate(whole):
        after = whole[(number + 1) % len(whole)]
        if isinstance(part, int):
            cubics.extend(fitted[part].cubics)
            lines.extend(fitted[part].lines.tolist())
            last = fitted[part].cubics[-1, 3]
        else:
            for a, b in itertools.pairwise(part):
                cubics.append(straight(a, b))
                lines.append(True)
            last = part[-1]
        goal = fitted[after].cubics[0, 0] if isinstance(after, int) else after[0]
        if hypot(*(goal - last)) > 1e-3:
            cubics.append(straight(last, goal))
            lines.append(True)
    return _joined(np.asarray(cubics), lines)


def _joined(cubics: Floats, lines: list[bool]) -> Pieces:
    """Lines that go on in the same direction are one."""
    kept: list[Floats] = []
    straight_kept: list[bool] = []
    for cubic, line in zip(cubics, lines, strict=True):
        if line and kept and straight_kept[-1] and _goes_on(kept[-1], cubic):
            kept[-1] = straight(kept[-1][0], cubic[3])
        else:
            kept.append(cubic)
            straight_kept.append(line)
    if len(kept) > 2 and straight_kept[0] and straight_kept[-1] and _goes_on(kept[-1], kept[0]):
        kept[0] = straight(kept.pop()[0], kept[0][3])
        straight_kept.pop()
    return Pieces(np.asarray(kept), np.asarray(straight_kept, np.bool_))


def _goes_on(one: Floats, other: Floats) -> bool:
    """Whether the joint of two lines is on the straight way from the first's start to the second's end."""
    way, here = other[3] - one[0], one[3] - one[0]
    size = float(hypot(*way))
    if size < 1e-6 or (here * way).sum() < 0 or ((other[3] - one[3]) * way).sum() < 0:
        return False
    return bool(abs(here[0] * way[1] - here[1] * way[0]) <= STRAIGHT * size)
