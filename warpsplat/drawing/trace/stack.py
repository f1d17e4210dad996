"""Regions as shapes that lie on one another.

Each boundary is drawn by the upper one of its two regions; the lower one goes on under it,
by the shortest path.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints
from warpsplat.drawing.trace.hidden import Cover, shortest_path
from warpsplat.drawing.trace.outlines import Boundary
from warpsplat.drawing.trace.planar import STEPS, Loops
from warpsplat.drawing.trace.spans import Polyline
from warpsplat.portable.elementary import cos, hypot, sin
from warpsplat.portable.linear import principal_direction

SEEN, EDGE, HIDDEN = range(3)
"""The side across a crack: a lower region, the outside of the image, a higher region."""

DOT = 8  # cracks of the largest loop that is a dot, whose shape cannot be told
STILL = 0.02  # [px] offset below which a boundary lies where the pixels meet
UNDER = 1.0  # [px] how far an outline goes on under the region above it before it turns
_ANGLES = np.linspace(0, 2 * np.pi, 12, endpoint=False)
CIRCLE = np.stack([cos(_ANGLES), sin(_ANGLES)], axis=1)
"""Points on the unit circle, shape (12, 2)."""

Outline = list[Polyline | Floats]
"""A contour before its curves are fitted: runs, and corners (point, 2) between one run and the next."""

Stretch = tuple[int, Ints]
"""The side across some cracks in a row, and the cracks."""


@dataclass(frozen=True)
class OutlineTracer:
    """The parts that outlines are made of."""

    loops: Loops
    boundary: Boundary
    ranks: Ints
    """Rank of each region in the order of painting, shape (region,)."""
    hiding: Ints
    """The same, -1 for regions under which nothing may lie, shape (region,)."""
    cover: Cover
    holed: Bools
    """Regions that are or contain something transparent, shape (region,)."""

    def outline(self, loop: int) -> Outline:
        """Return the contour of a loop; empty where it is hidden altogether."""
        low, high = int(self.loops.first[loop]), int(self.loops.first[loop + 1])
        cracks, rank = np.arange(low, high), int(self.ranks[self.loops.region[loop]])
        others = self.loops.others[low:high]
        kinds = np.where(self.hiding[np.maximum(others, 0)] > rank, HIDDEN, SEEN)
        kinds = np.where(others == NO_REGION, EDGE, kinds)
        if (kinds == HIDDEN).all():
            if self.loops.is_hole[loop] and not self._is_holed(loop):
                return []
            if self.loops.is_hole[loop]:  # left open, a little smaller than what lies over it
                between = 0.5 * (self.boundary.points[cracks] + self._middles(rank, cracks))
                return [Polyline(self._points(cracks, closed=True, places=between), closed=True)]
            kinds[:] = SEEN
        if (kinds == kinds[0]).all():
            return [self._ring(cracks) if kinds[0] == SEEN else self._vertices_at_turns(cracks)]
        first = int(np.flatnonzero(kinds != np.roll(kinds, 1))[0])
        cracks, kinds = np.roll(cracks, -first), np.roll(kinds, -first)
        bounds = [*np.flatnonzero(np.diff(kinds, prepend=-1)).tolist(), len(kinds)]
        stretches: list[Stretch] = [(int(kinds[a]), cracks[a:b]) for a, b in itertools.pairwise(bounds)]
        return self._chain(rank, stretches)

    def _is_holed(self, loop: int) -> bool:
        """Return whether anything transparent lies in the hole that a loop bounds."""
        return bool(self.holed[self.loops.region[self.loops.network == self.loops.network[loop]]].any())

    def _ring(self, cracks: Ints) -> Polyline | Floats:
        """Return a loop that is seen all around."""
        if len(cracks) <= DOT and np.abs(self.boundary.offsets[cracks]).max() > STILL:
            return self._dot(cracks)
        if self._is_pixel_exact(cracks):
            return self._vertices_at_turns(cracks)
        return Polyline(self._points(cracks, closed=True), closed=True)

    def _dot(self, cracks: Ints) -> Polyline:
        """Return a circle of the loop's area about its middle."""
        vertices = self.loops.vertices[cracks].astype(np.float64)
        following = np.roll(vertices, -1, axis=0)
        area = float((vertices[:, 0] * following[:, 1] - following[:, 0] * vertices[:, 1]).sum()) / 2
        full = area + float(self.boundary.offsets[cracks].sum())
        radius = np.sqrt(max(abs(full), 0.1) / np.pi)
        middle = self.boundary.points[cracks].mean(axis=0)
        return Polyline(middle + radius * CIRCLE * (1, np.sign(area)), closed=True)

    def _is_pixel_exact(self, cracks: Ints) -> bool:
        """Return whether a stretch lies where the pixels meet and has few corners."""
        if np.abs(self.boundary.offsets[cracks]).max() > STILL:
            return False
        turns = int((np.diff(self.loops.directions[cracks]) != 0).sum())
        return turns <= 4 + len(cracks) / 40

    def _vertices_at_turns(self, cracks: Ints) -> Floats:
        """Return the vertices where the cracks of a whole loop turn."""
        directions = self.loops.directions[cracks]
        return self.loops.vertices[cracks][directions != np.roll(directions, 1)].astype(np.float64)

    def _vertices_between(self, cracks: Ints) -> Floats:
        """Return the vertices where the cracks of a stretch turn, its ends aside."""
        directions = self.loops.directions[cracks]
        return self.loops.vertices[cracks[1:]][directions[1:] != directions[:-1]].astype(np.float64)

    def _points(self, cracks: Ints, *, closed: bool, places: Floats | None = None) -> Floats:
        """Return the good points of a stretch, or of other ``places``, without those at T-junctions."""
        if places is None:
            places = self.boundary.points[cracks]
        others = self.loops.others[cracks]
        change = others != np.roll(others, 1)
        if not closed:
            change[0] = False
        good = self.boundary.is_good[cracks]
        clean = good & ~(change | np.roll(change, -1))
        keep = clean if clean.sum() >= max(4, 0.5 * good.sum()) else good
        return places[keep] if keep.any() else places

    def _middles(self, rank: int, cracks: Ints) -> Floats:
        """Return points halfway through what hides a region beyond cracks, shape (crack, 2)."""
        steps = STEPS[self.loops.directions[cracks]]
        return self.cover.middles(rank, self.loops.vertices[cracks], steps, self.boundary.trends[cracks])

    def _chain(self, rank: int, stretches: list[Stretch]) -> Outline:
        """Return a loop that is seen in parts."""
        ends: list[tuple[Floats, Floats]] = []
        count = len(stretches)
        for number, (kind, cracks) in enumerate(stretches):
            first, last = self._ends(cracks)
            if kind == SEEN:
                points = self._points(cracks, closed=False)
                first = self._extended(rank, points[::-1], first, stretches[number - 1][0])
                last = self._extended(rank, points, last, stretches[(number + 1) % count][0])
            ends.append((first, last))
        parts: Outline = []
        for number, (kind, cracks) in enumerate(stretches):
            start, end = ends[number]
            if kind == SEEN and self._is_pixel_exact(cracks):
                corners = np.concatenate([start[None], self._vertices_between(cracks), end[None]])
                parts.append(Polyline(corners, False, is_polygon=True))
            elif kind == SEEN:
                parts.append(Polyline(self._points(cracks, closed=False), False, start, end))
            elif kind == EDGE:  # the image's corners, and where a hidden stretch ends or begins
                corners = np.concatenate([start[None], self._vertices_between(cracks), end[None]])
                begin = 0 if stretches[number - 1][0] == HIDDEN else 1
                stop = None if stretches[(number + 1) % count][0] == HIDDEN else -1
                parts.append(corners[begin:stop])
            else:
                start, end = ends[number - 1][1], ends[(number + 1) % count][0]
                goals = np.concatenate([start[None], self._middles(rank, cracks), end[None]])
                vertices = self.loops.vertices[[*cracks, cracks[-1], cracks[-1]]].astype(np.float64)
                # Something transparent may lie between regions as well as inside one.
                holed = bool(self.holed.any())
                parts.append(shortest_path(self.cover, rank, goals, vertices, through_holes=holed))
        return parts

    def _ends(self, cracks: Ints) -> tuple[Floats, Floats]:
        """Return the vertices where a stretch begins and ends."""
        last = cracks[-1]
        end = self.loops.vertices[last] + STEPS[self.loops.directions[last]]
        return self.loops.vertices[cracks[0]].astype(np.float64), end.astype(np.float64)

    def _extended(self, rank: int, points: Floats, vertex: Floats, kind: int) -> Floats:
        """Return where a seen stretch ends: beside its last vertex, or under what lies above.

        Args:
            rank: Of the region.
            points: Of the stretch, towards this end, shape (point, 2).
            vertex: Where its last crack ends.
            kind: Of the stretch that comes next.
        """
        tail = points[-5:]
        if len(tail) < 2:
            return vertex
        middle, direction = tail.mean(axis=0), principal_direction(tail)
        direction = direction if (direction * (tail[-1] - tail[0])).sum() > 0 else -direction
        if kind == EDGE:
            return self._extended_to_edge(middle, direction, vertex)
        ahead, behind = ((place - middle) * direction for place in (vertex, tail[-1]))
        reached = middle + direction * max(float(ahead.sum()), float(behind.sum()) + 0.1)
        if hypot(*(reached - vertex)) > 1.0:
            reached = vertex
        further = reached + UNDER * direction
        return further if self.cover.hides(rank, further[None])[0] else reached

    def _extended_to_edge(self, middle: Floats, direction: Floats, vertex: Floats) -> Floats:
        """Return where a line meets the edge of the image, or ``vertex`` if that is far away."""
        size = self.cover.ranks.shape[::-1]
        axis = 0 if vertex[0] in (0, size[0]) else 1
        if abs(direction[axis]) < 0.3:
            return vertex
        reached = middle + direction * (vertex[axis] - middle[axis]) / direction[axis]
        reached[axis] = vertex[axis]
        reached[1 - axis] = np.clip(reached[1 - axis], 0, size[1 - axis])
        return reached if hypot(*(reached - vertex)) < 1.5 else vertex
