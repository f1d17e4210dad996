"""Constraints that hold outlines together: lines, smooth joints, level and upright parts, borders."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.scene import Basis, IndexArray, Scene
from warpsplat.scene.attributes import Joint
from warpsplat.scene.scene import ranges, starts_of

Ints = npt.NDArray[np.int32]
Links = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float64]

SAME_COORDINATE = 1e-3
"""Difference [canvas units] below which coordinates are equal, like those of the ends of an upright line."""

MAX_LEVERAGE = 8.0
"""Maximum length of a handle that a line directs, in lengths of the line: rounding rotates longer ones."""

HELD_LEVERAGE = 1.0
"""The same where points are held after they were rounded."""

MIN_LENGTH = 1e-6
"""[canvas units] shorter vectors have no direction."""

MIN_HANDLE = 0.05
"""[canvas units] a handle of length 0 would have no direction, and the joint would be a corner."""


SIDES = tuple(enumerate((-1.0, 1.0)))
"""Before and after a joint: number, and sign along the outline."""

DRAFT_GRID = 8.0
"""View box units per pixel of a draft, and until the grid is chosen: a trace is no nearer to the image."""


@dataclass(frozen=True)
class Drawing:
    """Shapes whose outlines have constraints."""

    scene: Scene
    """Fills of cubics."""
    joints: Ints
    """``Joint`` of each point, shape (point,)."""

    def __post_init__(self) -> None:
        """Raise ``ValueError`` unless shapes agree, and the scene has fills of cubics only."""
        count = len(self.scene.points)
        if self.joints.shape != (count,):
            raise ValueError(f"joints has shape {self.joints.shape}, not ({count},)")
        if (self.scene.basis != Basis.CUBIC).any() or not self.scene.closed.all():
            raise ValueError("a drawing has closed outlines of cubics")

    def take(self, index: IndexArray) -> Drawing:
        """Return the shapes ``index``, in that order."""
        points = ranges(self.scene.first[:-1][index], self.scene.point_counts()[index])
        return Drawing(self.scene.take(index), self.joints[points])

    def contours(self, chosen: Links) -> Drawing:
        """Return contours as one shape."""
        points = ranges(self.scene.starts[:-1][chosen], np.diff(self.scene.starts)[chosen])
        return Drawing(of_contours(self.scene, chosen), self.joints[points])

    def contour(self) -> Links:
        """Return the contour of each cubic, shape (cubic,)."""
        counts = np.diff(self.scene.starts) // 3
        return np.repeat(np.arange(len(counts)), counts)

    def following(self) -> Links:
        """Return the cubic after each one on its contour, shape (cubic,); cubic i begins at point 3 i."""
        starts = self.scene.starts.astype(np.intp) // 3
        after = np.arange(1, starts[-1] + 1)
        filled = starts[1:] > starts[:-1]
        after[starts[1:][filled] - 1] = starts[:-1][filled]
        return after

    def neighbours(self) -> tuple[Links, Links]:
        """Return the cubic before, and after, each one on its contour, shape (cubic,)."""
        after = self.following()
        before = np.empty_like(after)
        before[after] = np.arange(len(after))
        return before, after

    def lines(self) -> Flags:
        """Return which cubics are straight lines, shape (cubic,)."""
        joints = self.joints.reshape(-1, 3)
        return np.asarray((joints[:, 1:] == Joint.LINE_HANDLE).all(axis=1))

    def cubics(self) -> Floats:
        """Return the control points of the cubics, shape (cubic, 4, 2)."""
        return with_ends(self.scene.points.astype(np.float64), self.following())


class Finished(NamedTuple):
    """A drawing as it is written."""

    drawing: Drawing
    """Rounded to the grid, unless it is a draft."""
    per_pixel: float
    """View box units per pixel."""
    psnr: float = math.nan
    """PSNR of the exact render before it is rounded [dB]; NaN if it was not fitted."""


def of_contours(scene: Scene, chosen: Links) -> Scene:
    """Return contours as one shape, painted as the first of ``scene``."""
    counts = np.diff(scene.starts)[chosen]
    points = scene.points[ranges(scene.starts[:-1][chosen], counts)]
    first, starts = np.array([0, len(points)], scene.first.dtype), starts_of(counts)
    one = scene.take(np.array([0]))
    return replace(one, points=points, first=first, starts=starts, closed=scene.closed[chosen])


def with_ends(points: Floats, following: Links) -> Floats:
    """Return the control points of the cubics on closed contours, shape (cubic, 4, 2)."""
    begun = points.reshape(-1, 3, 2)
    return np.concatenate([begun, begun[following, :1]], axis=1)


def rows_of(cubics: Floats) -> Floats:
    """Return the control points of cubics, shape (..., 4, 2), as kernels take them, shape (point, 2)."""
    return np.ascontiguousarray(cubics, np.float64).reshape(-1, 2)


def summed(index: Links, values: Floats, count: int) -> Floats:
    """Return the sums of ``values`` by ``index``, shape (count,)."""
    return np.bincount(index, values, count).astype(np.float64, copy=False)


class Constraints:
    """The constraints of a drawing: its points as functions of fewer numbers.

    Ends of level and upright lines share a coordinate, handles of lines are at the thirds, the two handles of
    a smooth joint have lengths and one angle, or the direction of the line there. Coordinates on the border
    stay as they are.
    """

    def __init__(self, drawing: Drawing, held: Flags | None = None) -> None:
        """``held``: points that stay where they are, shape (point,)."""
        scene = drawing.scene
        points = scene.points.astype(np.float64).reshape(-1, 3, 2)
        count = len(points)
        self._contour_first = scene.starts.astype(np.intp) // 3
        self._sorted: tuple[Links, Links, Links, Links] | None = None
        self._previous, self._next = drawing.neighbours()
        self._is_line = drawing.lines()
        on = points[:, 0]
        tied = self._is_line[:, None] & (np.abs(on - on[self._next]) < SAME_COORDINATE)
        self._find_joints(drawing, points, MAX_LEVERAGE if held is None else HELD_LEVERAGE)
        self._name_coordinates(tied)
        size = np.array([scene.canvas.width, scene.canvas.height])
        pinned = np.minimum(np.abs(points), np.abs(points - size)) < SAME_COORDINATE
        self._held = np.zeros(3 * count, np.bool_) if held is None else held
        self._places = points.reshape(-1, 2)[self._held]
        pinned |= self._held.reshape(-1, 3, 1)
        pinned[self._is_line, 1:] = False
        pinned.reshape(-1, 2)[self._directed()] = False
        self._pinned = np.zeros(6 * count, np.bool_)
        self._pinned[self._name[pinned.ravel()]] = True

    def _find_joints(self, drawing: Drawing, points: Floats, leverage: float) -> None:
        """Find the smooth joints that direct handles, and those whose tangents are level or upright."""
        on, before, line = points[:, 0], self._previous, self._is_line
        self._free = ~np.stack([line[before], line], axis=1)
        ends = np.where(self._free[..., None], np.stack([points[before, 2], points[:, 1]], axis=1), 0)
        ends = np.where(self._free[..., None], ends, np.stack([on[before], on[self._next]], axis=1))
        reach = np.linalg.norm(ends - on[:, None], axis=2)
        free = np.where(self._free, reach, 0).max(axis=1)
        turned = ~self._free.all(axis=1) & (free > leverage * np.where(self._free, 0, reach).max(axis=1))
        smooth = (drawing.joints[::3] == Joint.SMOOTH) & self._free.any(axis=1) & ~turned
        level = smooth[:, None] & (np.abs(ends - on[:, None]) < SAME_COORDINATE).all(axis=1)
        self._level = level
        self._bent = np.flatnonzero(smooth & ~level.any(axis=1))

    def _name_coordinates(self, tied: Flags) -> None:
        """Name each coordinate by a number, equal ones by the same."""
        count = len(tied)
        names = np.arange(6 * count).reshape(count, 3, 2)
        for axis in (0, 1):
            here = np.flatnonzero(tied[:, axis])
            ends = np.stack([here, self._next[here]])
            while (names[ends[0], 0, axis] != names[ends[1], 0, axis]).any():
                least = names[ends, 0, axis].min(axis=0)
                for end in ends:  # a point ends one line at the most, and begins one
                    names[end, 0, axis] = np.minimum(names[end, 0, axis], least)
        for side, (owner, handle) in enumerate(((self._previous, 2), (np.arange(count), 1))):
            joint, axes = np.nonzero(self._level & self._free[:, side, None])
            names[owner[joint], handle, axes] = names[joint, 0, axes]
        self._name = names.ravel()

    def _handles(self, side: int) -> tuple[Links, Links]:
        """Return the bent joints with a free handle before (0) or after (1) them, and these handles."""
        joints = self._bent[self._free[self._bent, side]]
        return joints, (3 * self._previous[joints] + 2, 3 * joints + 1)[side]

    def _directed(self) -> Links:
        """Return the handles that bent joints direct."""
        return np.concatenate([self._handles(0)[1], self._handles(1)[1]])

    def directions(self, points: Floats) -> Floats:
        """Return unit vectors along the outline at the bent joints; 0 where there is none. Shape (joint, 2).

        A line gives it. Of two free handles it is the axis from which they lie least apart, by squares.
        """
        begun, at = points.reshape(-1, 3, 2), self._bent
        before, after = self._previous[at], self._next[at]
        p, free = begun[at, 0], self._free[at]
        back, ahead = p - begun[before, 2], begun[at, 1] - p
        square = ((back * back) + (ahead * ahead)).T
        mixed = back[:, 0] * back[:, 1] + ahead[:, 0] * ahead[:, 1]
        # The eigenvector of the larger eigenvalue, by the row that is not near zero.
        half = 0.5 * (square[0] - square[1])
        root = np.sqrt(half * half + mixed * mixed)
        axis = np.stack([np.where(half < 0, mixed, half + root), np.where(half < 0, root - half, mixed)], 1)
        axis *= np.where((axis * (back + ahead)).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        axis = np.where(free[:, :1], axis, p - begun[before, 0])
        axis = np.where(free[:, 1:], axis, begun[after, 0] - p)
        length = np.linalg.norm(axis, axis=1)[:, None]
        return np.asarray(np.where(length > MIN_LENGTH, axis / np.maximum(length, MIN_LENGTH), 0.0))

    def _bends(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the direction at each joint, 0 unless it is bent, and the lengths of its handles."""
        along, lengths = np.zeros((2, len(points) // 3, 2))
        along[self._bent] = self.directions(points)
        for side, sign in SIDES:
            joints, handles = self._handles(side)
            reach = (points[handles] - points[3 * joints]) * along[joints]
            lengths[joints, side] = sign * reach.sum(axis=1)
        return along, lengths

    def shared(self, points: Floats) -> Floats:
        """Return ``points``, shape (point, 2), with the coordinates that they have in common."""
        return points.ravel()[self._name].reshape(-1, 2)

    def project(self, points: Floats) -> Floats:
        """Return ``points``, shape (point, 2), with the constraints kept exactly."""
        points = self.shared(points)
        along, lengths = self._bends(points)
        for side, sign in SIDES:
            joints, handles = self._handles(side)
            known = along[joints].any(axis=1)
            j, h = joints[known], handles[known]
            length = np.maximum(lengths[j, side, None], MIN_HANDLE)
            points[h] = points[3 * j] + sign * length * along[j]
        begun = points.reshape(-1, 3, 2)
        a, b = begun[self._is_line, 0], begun[self._next[self._is_line], 0]
        begun[self._is_line, 1:] = np.stack([a + (b - a) / 3, b - (b - a) / 3], axis=1)
        points[self._held] = self._places
        return points

    def freedom(self, points: Floats) -> Freedom:
        """Return how the coordinates of ``points``, which keep the constraints, depend on free numbers."""
        entries: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Floats]] = []
        direct = np.ones(len(points), np.bool_)
        direct.reshape(-1, 3)[self._is_line, 1:] = False
        direct[self._directed()] = False
        rows = np.flatnonzero(np.repeat(direct, 2))
        entries.append((rows, self._name[rows], np.ones(len(rows))))

        def add(target: Links, source: Links, values: Floats) -> None:
            """Let points ``target`` depend on ``source``: values (point, 2, 2) by axes, or one for both."""
            for i in (0, 1):
                for j in (0, 1):
                    if values.ndim == 3 or i == j:
                        value = values[:, i, j] if values.ndim == 3 else values
                        entries.append((2 * target + i, self._name[2 * source + j], value))

        line = np.flatnonzero(self._is_line)
        for handle, share in ((1, 1 / 3), (2, 2 / 3)):
            add(3 * line + handle, 3 * line, np.full(len(line), 1 - share))
            add(3 * line + handle, 3 * self._next[line], np.full(len(line), share))
        along, lengths = self._bends(points)
        for side, sign in SIDES:
            joints, handles = self._handles(side)
            u = along[joints]
            n = np.stack([-u[:, 1], u[:, 0]], axis=1)
            add(handles, 3 * joints, np.ones(len(joints)))
            for i in (0, 1):
                entries.append((2 * handles + i, 2 * handles, sign * u[:, i]))
            both = self._free[joints].all(axis=1)
            # Both free: the angle is named after the second coordinate of the handle before the joint.
            j, h = joints[both], handles[both]
            radius = np.sqrt((lengths[j] ** 2).sum(axis=1))
            angle = 2 * (3 * self._previous[j] + 2) + 1
            turn = sign * lengths[j, side] / np.maximum(radius, MIN_LENGTH)
            for i in (0, 1):
                entries.append((2 * h + i, angle, turn * n[both, i]))
            # One free: it turns with the line on the other side.
            j, h, across = joints[~both], handles[~both], n[~both]
            begin, end = (j, self._next[j]) if side == 0 else (self._previous[j], j)
            span = np.linalg.norm(points[3 * end] - points[3 * begin], axis=1)
            turn = sign * lengths[j, side] / np.maximum(span, MIN_LENGTH)
            turning = turn[:, None, None] * across[:, :, None] * across[:, None, :]
            add(h, 3 * end, turning)
            add(h, 3 * begin, -turning)
        if not self._sorted:
            rows, columns = (np.concatenate([entry[k] for entry in entries]) for k in (0, 1))
            kept = np.flatnonzero(~(self._pinned[columns] | self._held[rows // 2]))
            contour = np.searchsorted(self._contour_first, rows[kept] // 6, "right") - 1
            order = kept[np.argsort(contour, kind="stable")]
            ends = np.cumsum(np.bincount(contour, minlength=len(self._contour_first) - 1))
            self._sorted = order, rows[order], columns[order], np.append(0, ends)
        order, row, column, entry_first = self._sorted
        value = np.concatenate([entry[2] for entry in entries])[order]
        return Freedom(row, column, value, 2 * len(points), self._contour_first, entry_first)


@dataclass(frozen=True)
class Freedom:
    """A sparse matrix from free numbers to coordinates of points, sorted by contour."""

    row: Links
    column: Links
    value: Floats
    size: int
    contour_first: Links
    """The cubics of each contour begin here, and end with the next, shape (contour + 1,)."""
    entry_first: Links
    """The entries, in the same way."""

    def times(self, numbers: Floats) -> Floats:
        """Return the change of the coordinates, shape (size,)."""
        return summed(self.row, self.value * numbers[self.column], self.size)

    def adjoint(self, coordinates: Floats) -> Floats:
        """Return the transposed matrix times ``coordinates``."""
        return summed(self.column, self.value * coordinates[self.row], self.size)
