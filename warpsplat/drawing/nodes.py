"""Candidates for simpler outlines: fewer, straighter or more upright pieces.

Each is an ``Edit`` of the arrays, with the part of the canvas that it changes and the bytes that it saves.
How much it costs is measured by rendering (``drawing.tidy``).
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.cells import Cells, cells_around, joined
from warpsplat.drawing.merge import handles_through
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.fit.constraints import SAME_COORDINATE, Drawing
from warpsplat.scene.attributes import Joint

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

MOST_DISTANCE = 0.6  # [canvas units] that a candidate may move an outline, where bytes have their usual price
LEVEL_SLOPE = 0.06  # slope below which a line, or a tangent, may be made level or upright
CUBIC_BYTES, LINE_BYTES, HANDLES_BYTES, NUMBER_BYTES = 19, 7, 12, 3
"""Bytes of a cubic, a line, the handles of a cubic and a number in a file."""

Key = tuple[str, int, int]
CUBICS_AT_ONCE = 512  # candidates that are measured at once, which bounds their memory to some megabytes


def key_of(kind: str, at: tuple[float, float]) -> Key:
    """Return the key of an ``Edit``."""
    return kind, round(at[0] / 2), round(at[1] / 2)


@dataclass(frozen=True)
class Edit:
    """A change of a drawing."""

    kind: str
    at: tuple[float, float]
    """Where it is [canvas units]."""
    cells: Cells
    """Cells that it may change."""
    off: float
    """How far it moves the outline, about [canvas units]."""
    saved: int
    """Bytes."""
    points: dict[int, Any] = field(default_factory=dict)
    """Points that move, and where to."""
    joints: dict[int, Joint] = field(default_factory=dict)
    removed: tuple[int, ...] = ()

    @property
    def key(self) -> Key:
        """Its name from round to round, in which the numbers of its points change."""
        return key_of(self.kind, self.at)


def applied(drawing: Drawing, edits: Sequence[Edit]) -> Drawing:
    """Return the drawing after ``edits`` that have no points in common."""
    points, joints = drawing.scene.points.copy(), drawing.joints.copy()
    keep = np.ones(len(points), np.bool_)
    for edit in edits:
        for i, place in edit.points.items():
            points[i] = place
        for i, joint in edit.joints.items():
            joints[i] = joint
        keep[list(edit.removed)] = False
    scene = replace(drawing.scene, points=points).without_points(keep)
    return Drawing(scene, joints[keep], drawing.same[keep])


def turned(drawing: Drawing) -> Drawing:
    """Return the same outlines, each begun at another point: the first point is never removed."""
    starts = drawing.scene.starts
    order = np.concatenate(
        [np.roll(np.arange(a, b), -3 * max(1, (b - a) // 6)) for a, b in pairwise(starts.tolist())]
    )
    scene = replace(drawing.scene, points=drawing.scene.points[order])
    return Drawing(scene, drawing.joints[order], drawing.same[order])


class Outlines:
    """A drawing's outlines by the numbers of their points; the points of several shapes share places."""

    def __init__(self, drawing: Drawing, reach: float = MOST_DISTANCE) -> None:
        """``reach``: how far a candidate may move an outline [canvas units]."""
        self._reach = reach
        self._size = (drawing.scene.canvas.width, drawing.scene.canvas.height)
        self._points = drawing.scene.points.astype(np.float64)
        on, following = drawing.links()
        self._on = on.tolist()
        self._next = dict(zip(self._on, following.tolist(), strict=True))
        self._previous = {b: a for a, b in self._next.items()}
        self._is_line = dict(zip(self._on, drawing.lines().tolist(), strict=True))
        self._place = np.where(drawing.same >= 0, drawing.same, -1 - np.arange(len(self._points))).tolist()
        self._members_at: dict[int, list[int]] = {}
        for i, place in enumerate(self._place):
            self._members_at.setdefault(place, []).append(i)
        starts = drawing.scene.starts
        self._firsts = set(starts[:-1].tolist())
        self._sizes = np.repeat(np.diff(starts), np.diff(starts)).tolist()
        self._is_smooth: list[bool] = (drawing.joints == Joint.SMOOTH).tolist()

    def edits(self, refused: Set[Key] = frozenset()) -> list[Edit]:
        """Return all candidates except the ``refused`` ones, whose number grows with each round."""

        def is_open(kind: str, point: int) -> bool:
            return key_of(kind, self._at(point)) not in refused

        found: list[Edit | None] = []
        # Each place once for all shapes.
        done: set[int] = set()
        places = []
        for p in self._on:
            if self._place[p] not in done:
                done.add(self._place[p])
                places.append(p)
        merged = self._merged([p for p in places if self._is_spare(p) and is_open("without", p)])
        leaning, sloping = self._leaning(), self._sloping()
        for p in places:
            if p in merged:
                found.append(self._without(p, *merged[p]))
            if p in leaning and is_open("tangent", p):
                found.append(self._level_tangent(p, *leaning[p]))
        firsts = [a for a in self._on if min(self._members(a + 1) + self._members(a + 2)) >= a]
        thirds = self._thirds([a for a in firsts if not self._is_line[a] and is_open("straight", a + 1)])
        for a in firsts:
            if a in sloping and is_open("level", a + 1):
                found.append(self._level_line(a, *sloping[a]))
            elif a in thirds:
                found.append(self._straight(a, *thirds[a]))
        return [edit for edit in found if edit]

    def _members(self, point: int) -> list[int]:
        """Return all points at the place of ``point``."""
        return self._members_at[self._place[point]]

    def _corners(self, a: int) -> Floats:
        """Return the cubic that begins at ``a``, shape (4, 2)."""
        return self._points[[a, a + 1, a + 2, self._next[a]]]

    def _at(self, p: int) -> tuple[float, float]:
        x, y = self._points[p].tolist()
        return x, y

    @cached_property
    def _cubic_cells(self) -> dict[int, Cells]:
        """The cells around the cubic that begins at each point."""
        on = np.array(self._on)
        following = [self._next[a] for a in self._on]
        cubics = self._points[np.stack([on, on + 1, on + 2, following], axis=1)]
        return dict(zip(self._on, cells_around(cubics), strict=True))

    def _cells(self, *starts: int) -> Cells:
        """Return the cells around the cubics that begin at ``starts``, and those that change with them."""
        wide = set(starts)
        for a in starts:
            if self._is_smooth[a]:
                wide.add(self._previous[a])
            if self._is_smooth[self._next[a]]:
                wide.add(self._next[a])
        return joined([self._cubic_cells[a] for a in wide])

    def _is_spare(self, p: int) -> bool:
        """Return whether the pieces that meet in ``p`` meet nothing else there."""
        ends = {self._place[self._previous[p]], self._place[self._next[p]]}
        return len(ends) == 2 and all(
            m not in self._firsts
            and self._sizes[m] > 6
            and {self._place[self._previous[m]], self._place[self._next[m]]} == ends
            for m in self._members(p)
        )

    def _merged(self, spare: list[int]) -> dict[int, tuple[Floats, float]]:
        """Find the points that can go: handles of one piece for the two there, and how far it is off.

        All at once: there are hundreds, and each alone takes a millisecond.
        """
        if not spare:
            return {}
        first = np.stack([self._corners(self._previous[p]) for p in spare])
        second = np.stack([self._corners(p) for p in spare])
        straight = np.array([self._is_line[self._previous[p]] and self._is_line[p] for p in spare])
        whole = np.stack([first[:, 0], second[:, 3]], axis=1)
        handles = np.where(straight[:, None, None], thirds_between(whole), handles_through(first, second))
        off = _apart(np.concatenate([whole[:, :1], handles, whole[:, 1:]], axis=1), first, second)
        return {spare[i]: (handles[i], float(off[i])) for i in np.flatnonzero(off <= self._reach).tolist()}

    def _without(self, p: int, handles: Floats, off: float) -> Edit:
        """Return the edit that makes one piece of the two that meet in ``p``."""
        members = self._members(p)
        a = self._previous[p]
        lines = self._is_line[a] + self._is_line[p]
        points, joints, removed = {}, {}, []
        kind = Joint.LINE_HANDLE if lines == 2 else Joint.FREE
        for m in members:
            before = self._previous[m]
            forward = self._place[before] == self._place[a]
            points[before + 1], points[m + 2] = handles if forward else handles[::-1]
            joints[before + 1] = joints[m + 2] = kind
            removed += [before + 2, m, m + 1]
        saved = (LINE_BYTES if lines else CUBIC_BYTES) * len(members)
        return Edit("without", self._at(p), self._cells(a, p), off, saved, points, joints, tuple(removed))

    def _thirds(self, starts: Sequence[int]) -> dict[int, tuple[Floats, float]]:
        """Find the cubics at ``starts`` that are nearly lines: their thirds, and how far the line is off."""
        if not starts:
            return {}
        corners = np.stack([self._corners(a) for a in starts])
        thirds = thirds_between(corners[:, [0, 3]])
        off = _apart(np.concatenate([corners[:, :1], thirds, corners[:, 3:]], axis=1), corners)
        return {starts[i]: (thirds[i], float(off[i])) for i in np.flatnonzero(off <= self._reach).tolist()}

    def _straight(self, a: int, thirds: Floats, off: float) -> Edit:
        """Return the edit that makes a line of a cubic."""
        saved = HANDLES_BYTES * len(self._members(a + 1))
        points, joints = {}, {}
        for handle, third in zip((a + 1, a + 2), thirds, strict=True):
            for m in self._members(handle):
                points[m], joints[m] = third, Joint.LINE_HANDLE
        b = self._next[a]
        for end, beyond in ((a, self._previous[a]), (b, b)):
            if self._is_line[beyond]:
                joints |= dict.fromkeys(self._members(end), Joint.CORNER)
        return Edit("straight", self._at(a + 1), self._cells(a), off, saved, points, joints)

    def _sloping(self) -> dict[int, tuple[int, float]]:
        """Find the lines that are nearly level or upright: in which axis their ends differ, and how much."""
        starts = np.array([a for a in self._on if self._is_line[a]], np.intp)
        offsets = np.abs(self._points[[self._next[a] for a in starts.tolist()]] - self._points[starts])
        off, along = offsets.min(axis=1), offsets.max(axis=1)
        near = (off >= SAME_COORDINATE) & (off <= np.minimum(LEVEL_SLOPE * along, self._reach))
        return _by_point(near, starts, offsets.argmin(axis=1), off)

    def _level_line(self, a: int, axis: int, off: float) -> Edit | None:
        """Return the edit that makes a line level or upright; None if both of its ends are held."""
        b = self._next[a]
        is_held = [self._is_held(end, axis) for end in (a, b)]
        if all(is_held):
            return None
        ends = self._points[[a, b], axis]
        points = self._moved((a, b), axis, ends[is_held.index(True)] if any(is_held) else ends.mean())
        cells = self._cells(a, self._previous[a], b)
        return Edit("level", self._at(a + 1), cells, off, NUMBER_BYTES * len(self._members(a)), points)

    def _moved(self, points: Sequence[int], axis: int, value: Any) -> dict[int, Floats]:
        """Return points, and all at their places, with a coordinate set to ``value``."""
        moved = {}
        for m in (m for p in points for m in self._members(p)):
            moved[m] = self._points[m].copy()
            moved[m][axis] = value
        return moved

    def _is_held(self, p: int, axis: int) -> bool:
        """Return whether a level or upright line, or the border, holds a coordinate of ``p``."""
        if min(abs(self._points[p, axis]), abs(self._points[p, axis] - self._size[axis])) < SAME_COORDINATE:
            return True
        return any(
            self._is_line[a] and abs(self._points[end, axis] - self._points[m, axis]) < SAME_COORDINATE
            for m in self._members(p)
            for a, end in ((m, self._next[m]), (self._previous[m], self._previous[m]))
        )

    def _leaning(self) -> dict[int, tuple[int, float]]:
        """Find the smooth joints whose tangents are nearly level or upright.

        Returns:
            The axis in which their handles differ little from them, and by how much.
        """
        smooth = [p for p in self._on if self._is_smooth[p] and not self._is_line[p]]
        joints = np.array([p for p in smooth if not self._is_line[self._previous[p]]], np.intp)
        before = np.array([self._previous[p] for p in joints.tolist()], np.intp)
        handles = self._points[np.stack([before + 2, joints + 1], axis=1)]
        offsets = np.abs(handles - self._points[joints][:, None])
        axes = offsets.sum(axis=1).argmin(axis=1)
        across = np.take_along_axis(offsets, axes[:, None, None], axis=2)[..., 0]
        along = np.take_along_axis(offsets, 1 - axes[:, None, None], axis=2)[..., 0]
        off = across.max(axis=1)
        near = (off >= SAME_COORDINATE) & (across <= LEVEL_SLOPE * along).all(axis=1)
        return _by_point(near, joints, axes, off)

    def _level_tangent(self, p: int, axis: int, off: float) -> Edit:
        """Return the edit that makes the tangent of a smooth joint level or upright."""
        a = self._previous[p]
        points = self._moved((a + 2, p + 1), axis, self._points[p, axis])
        saved = NUMBER_BYTES * len(self._members(p))
        return Edit("tangent", self._at(p), self._cells(a, p), 0.4 * off, saved, points)


def _by_point(
    chosen: npt.NDArray[np.bool_], points: Indices, axes: Indices, off: Floats
) -> dict[int, tuple[int, float]]:
    """Return axis and distance by point, for the chosen ones."""
    kept = zip(points[chosen].tolist(), axes[chosen].tolist(), off[chosen].tolist(), strict=True)
    return {point: (axis, distance) for point, axis, distance in kept}


def thirds_between(ends: Floats) -> Floats:
    """Return the points at the thirds of lines, shape (line, 2, 2), between ``ends`` of the same shape."""
    return (2 * ends + ends[:, ::-1]) / 3


def _apart(made: Floats, *pieces: Floats) -> Floats:
    """Return about the largest distance of ``pieces`` from the cubics ``made``, all (cubic, 4, 2)."""
    t = np.linspace(0, 1, 17)
    samples = np.concatenate([points_at(piece, t[1:-1:2]) for piece in pieces], axis=1)
    found = []
    for first in range(0, len(made), CUBICS_AT_ONCE):
        curve = points_at(made[first : first + CUBICS_AT_ONCE], t)[:, None]
        offsets = np.diff(curve, axis=2)
        behind = samples[first : first + CUBICS_AT_ONCE, :, None] - curve[:, :, :-1]
        along = (behind * offsets).sum(axis=3) / np.maximum((offsets**2).sum(axis=3), 1e-12)
        apart = behind - np.clip(along, 0, 1)[..., None] * offsets
        found.append(np.linalg.norm(apart, axis=3).min(axis=2).max(axis=1))
    return np.concatenate(found)
