"""What a drawing's outlines may do without: candidates for fewer, straighter or more upright pieces.

Each is an ``Edit`` of the arrays, with the part of the canvas that it changes and the bytes that it spares.
What it costs is for the renderer to say (``drawing.tidy``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.cells import Cells, cells_around, joined
from warpsplat.drawing.merge import handles_through, points_at
from warpsplat.fit.constraints import EQUAL, Drawing
from warpsplat.scene.joints import Joint

Floats = npt.NDArray[np.float64]

MOST_OFF = 0.6
"""How far a candidate may move an outline [canvas units], where bytes have their usual price."""

STEEP = 0.06
"""Slope below which a line may be level, or upright, and a tangent likewise."""

AT_ONCE = 512
"""Candidates that are measured in one go: bounds their memory to some megabytes."""

CUBIC_BYTES, LINE_BYTES, HANDLES_BYTES, NUMBER_BYTES = 19, 7, 12, 3
"""What a cubic, a line, the handles of a cubic and a number take in a file."""


Key = tuple[str, int, int]


def key_of(kind: str, at: tuple[float, float]) -> Key:
    """Of an ``Edit``."""
    return kind, round(at[0] / 2), round(at[1] / 2)


@dataclass(frozen=True)
class Edit:
    """A change of a drawing."""

    kind: str
    at: tuple[float, float]
    """Where it is [canvas units]."""
    cells: Cells
    """What it may change."""
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
        """What names it from round to round, whatever the numbers of its points are."""
        return key_of(self.kind, self.at)


def applied(drawing: Drawing, edits: Sequence[Edit]) -> Drawing:
    """The drawing with ``edits`` that have no points in common."""
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
    """The same outlines, each from another of its points on: the first one is never removed."""
    starts = drawing.scene.starts
    order = np.concatenate(
        [np.roll(np.arange(a, b), -3 * max(1, (b - a) // 6)) for a, b in pairwise(starts.tolist())]
    )
    scene = replace(drawing.scene, points=drawing.scene.points[order])
    return Drawing(scene, drawing.joints[order], drawing.same[order])


class Outlines:
    """A drawing's outlines, place by place."""

    def __init__(self, drawing: Drawing, reach: float = MOST_OFF) -> None:
        """``reach``: how far a candidate may move an outline [canvas units]."""
        self.drawing, self._reach = drawing, reach
        self.points = drawing.scene.points.astype(np.float64)
        on, following = drawing.links()
        self.on = on.tolist()
        self.next = dict(zip(self.on, following.tolist(), strict=True))
        self.previous = {b: a for a, b in self.next.items()}
        self.is_line = dict(zip(self.on, drawing.lines().tolist(), strict=True))
        count = len(self.points)
        self.place = np.where(drawing.same >= 0, drawing.same, -1 - np.arange(count)).tolist()
        self._cells: dict[int, Cells] = {}
        """Around the cubic that begins at each point, once they are asked for."""
        self._members: dict[int, list[int]] = {}
        for i, place in enumerate(self.place):
            self._members.setdefault(place, []).append(i)
        starts = drawing.scene.starts
        self._firsts = set(starts[:-1].tolist())
        sizes = np.repeat(np.diff(starts), np.diff(starts))
        self._sizes = sizes.tolist()
        self._is_smooth: list[bool] = (drawing.joints == Joint.SMOOTH).tolist()
        self._refused: Set[Key] = frozenset()

    def members(self, point: int) -> list[int]:
        """All points at the place of ``point``."""
        return self._members[self.place[point]]

    def corners(self, a: int) -> Floats:
        """The cubic that begins at ``a``, shape (4, 2)."""
        return self.points[[a, a + 1, a + 2, self.next[a]]]

    def cells(self, *starts: int) -> Cells:
        """Around the cubics that begin at ``starts``, and those that turn with them."""
        wide = set(starts)
        for a in starts:
            if self._is_smooth[a]:
                wide.add(self.previous[a])
            if self._is_smooth[self.next[a]]:
                wide.add(self.next[a])
        if not self._cells:
            on = np.array(self.on)
            following = [self.next[a] for a in self.on]
            cubics = self.points[np.stack([on, on + 1, on + 2, following], axis=1)]
            self._cells = dict(zip(self.on, cells_around(cubics), strict=True))
        return joined([self._cells[a] for a in wide])

    def _at(self, p: int) -> tuple[float, float]:
        x, y = self.points[p].tolist()
        return x, y

    def edits(self, refused: Set[Key] = frozenset()) -> list[Edit]:
        """All candidates but the ``refused`` ones: of those there are more with every round."""
        self._refused = refused
        found: list[Edit] = []
        merged = self._merged()
        leaning, sloping = self._leaning(), self._sloping()
        done: set[int] = set()
        for p in self.on:
            if self.place[p] in done:
                continue
            done.add(self.place[p])
            if p in merged:
                found.append(self._without(p, *merged[p]))
            if p in leaning:
                found += self._level_tangent(p, *leaning[p])
        # Once for all shapes.
        firsts = [a for a in self.on if min(self.members(a + 1) + self.members(a + 2)) >= a]
        thirds = self._thirds([a for a in firsts if not self.is_line[a] and self._is_open("straight", a + 1)])
        for a in firsts:
            if a in sloping:
                found += self._level_line(a, *sloping[a])
            elif a in thirds:
                found.append(self._straight(a, *thirds[a]))
        return found

    def _is_open(self, kind: str, point: int) -> bool:
        """Whether an edit of this kind at ``point`` was not refused."""
        return key_of(kind, self._at(point)) not in self._refused

    def _is_spare(self, p: int) -> bool:
        """Whether the pieces that meet in ``p`` meet nothing else there."""
        ends = {self.place[self.previous[p]], self.place[self.next[p]]}
        if len(ends) < 2:
            return False
        return all(
            m not in self._firsts
            and self._sizes[m] > 6
            and {self.place[self.previous[m]], self.place[self.next[m]]} == ends
            for m in self.members(p)
        )

    def _merged(self) -> dict[int, tuple[Floats, float]]:
        """Points that need not be: the handles of one piece in place of the two that meet there, and how far
        it moves the outline.

        All at once: there are hundreds, and each alone takes a millisecond.
        """
        done: set[int] = set()
        spare = []
        for p in self.on:
            if self.place[p] not in done and self._is_spare(p) and self._is_open("without", p):
                spare.append(p)
            done.add(self.place[p])
        if not spare:
            return {}
        first = np.stack([self.corners(self.previous[p]) for p in spare])
        second = np.stack([self.corners(p) for p in spare])
        straight = np.array([self.is_line[self.previous[p]] and self.is_line[p] for p in spare])
        whole = np.stack([first[:, 0], second[:, 3]], axis=1)
        handles = np.where(straight[:, None, None], thirds_between(whole), handles_through(first, second))
        off = _apart(np.concatenate([whole[:, :1], handles, whole[:, 1:]], axis=1), first, second)
        return {spare[i]: (handles[i], float(off[i])) for i in np.flatnonzero(off <= self._reach).tolist()}

    def _without(self, p: int, handles: Floats, off: float) -> Edit:
        """The two pieces that meet in ``p`` as one."""
        members = self.members(p)
        a = self.previous[p]
        lines = self.is_line[a] + self.is_line[p]
        points, joints, removed = {}, {}, []
        kind = Joint.LINE_HANDLE if lines == 2 else Joint.FREE
        for m in members:
            before = self.previous[m]
            forward = self.place[before] == self.place[a]
            points[before + 1], points[m + 2] = handles if forward else handles[::-1]
            joints[before + 1] = joints[m + 2] = kind
            removed += [before + 2, m, m + 1]
        saved = (LINE_BYTES if lines else CUBIC_BYTES) * len(members)
        return Edit("without", self._at(p), self.cells(a, p), off, saved, points, joints, tuple(removed))

    def _thirds(self, starts: Sequence[int]) -> dict[int, tuple[Floats, float]]:
        """Of the cubics that begin at ``starts`` those that are about lines: their thirds, and how far off
        the line is.
        """
        if not starts:
            return {}
        corners = np.stack([self.corners(a) for a in starts])
        thirds = thirds_between(corners[:, [0, 3]])
        off = _apart(np.concatenate([corners[:, :1], thirds, corners[:, 3:]], axis=1), corners)
        return {starts[i]: (thirds[i], float(off[i])) for i in np.flatnonzero(off <= self._reach).tolist()}

    def _straight(self, a: int, thirds: Floats, off: float) -> Edit:
        """A cubic as a line."""
        saved = HANDLES_BYTES * len(self.members(a + 1))
        points, joints = {}, {}
        for handle, third in zip((a + 1, a + 2), thirds, strict=True):
            for m in self.members(handle):
                points[m], joints[m] = third, Joint.LINE_HANDLE
        b = self.next[a]
        for end, beyond in ((a, self.previous[a]), (b, b)):
            if self.is_line[beyond]:
                joints |= dict.fromkeys(self.members(end), Joint.CORNER)
        return Edit("straight", self._at(a + 1), self.cells(a), off, saved, points, joints)

    def _sloping(self) -> dict[int, tuple[int, float]]:
        """The lines that are almost level or upright: the axis in which their ends differ little, and by how
        much.
        """
        starts = np.array([a for a in self.on if self.is_line[a]], np.intp)
        ways = np.abs(self.points[[self.next[a] for a in starts.tolist()]] - self.points[starts])
        axes = ways.argmin(axis=1)
        off, along = ways.min(axis=1), ways.max(axis=1)
        near = (off >= EQUAL) & (off <= np.minimum(STEEP * along, self._reach))
        return _picked(near, starts, axes, off)

    def _level_line(self, a: int, axis: int, off: float) -> Iterator[Edit]:
        """A line that is almost level or upright, so."""
        if not self._is_open("level", a + 1):
            return
        b = self.next[a]
        bound = [self._is_bound(end, axis) for end in (a, b)]
        if all(bound):
            return
        ends = self.points[[a, b], axis]
        level = ends[bound.index(True)] if any(bound) else ends.mean()
        points = {}
        for end in (a, b):
            for m in self.members(end):
                points[m] = self.points[m].copy()
                points[m][axis] = level
        cells = self.cells(a, self.previous[a], b)
        saved = NUMBER_BYTES * len(self.members(a))
        yield Edit("level", self._at(a + 1), cells, off, saved, points)

    def _is_bound(self, p: int, axis: int) -> bool:
        """Whether a level or upright line, or the border, holds a coordinate of ``p``."""
        size = (self.drawing.scene.canvas.width, self.drawing.scene.canvas.height)[axis]
        if min(abs(self.points[p, axis]), abs(self.points[p, axis] - size)) < EQUAL:
            return True
        for m in self.members(p):
            for a, end in ((m, self.next[m]), (self.previous[m], self.previous[m])):
                if self.is_line[a] and abs(self.points[end, axis] - self.points[m, axis]) < EQUAL:
                    return True
        return False

    def _leaning(self) -> dict[int, tuple[int, float]]:
        """The smooth joints whose tangents are almost level or upright: the axis in which their handles
        differ little from them, and by how much.
        """
        smooth = [p for p in self.on if self._is_smooth[p] and not self.is_line[p]]
        joints = np.array([p for p in smooth if not self.is_line[self.previous[p]]], np.intp)
        before = np.array([self.previous[p] for p in joints.tolist()], np.intp)
        ways = np.abs(self.points[np.stack([before + 2, joints + 1], axis=1)] - self.points[joints][:, None])
        axes = ways.sum(axis=1).argmin(axis=1)
        across = np.take_along_axis(ways, axes[:, None, None], axis=2)[..., 0]
        along = np.take_along_axis(ways, 1 - axes[:, None, None], axis=2)[..., 0]
        off = across.max(axis=1)
        near = (off >= EQUAL) & (across <= STEEP * along).all(axis=1)
        return _picked(near, joints, axes, off)

    def _level_tangent(self, p: int, axis: int, off: float) -> Iterator[Edit]:
        """A smooth joint whose tangent is almost level or upright, so."""
        if not self._is_open("tangent", p):
            return
        a = self.previous[p]
        handles = (a + 2, p + 1)
        points = {}
        for handle in handles:
            for m in self.members(handle):
                points[m] = self.points[m].copy()
                points[m][axis] = self.points[p, axis]
        yield Edit(
            "tangent", self._at(p), self.cells(a, p), 0.4 * off, NUMBER_BYTES * len(self.members(p)), points
        )


def _picked(
    near: npt.NDArray[np.bool_],
    points: npt.NDArray[np.intp],
    axes: npt.NDArray[np.intp],
    off: Floats,
) -> dict[int, tuple[int, float]]:
    """Axis and distance by point, of those that are near."""
    kept = zip(points[near].tolist(), axes[near].tolist(), off[near].tolist(), strict=True)
    return {point: (axis, distance) for point, axis, distance in kept}


def thirds_between(ends: Floats) -> Floats:
    """Points at the thirds of lines, shape (line, 2, 2), between their ``ends``, in the same shape."""
    return (2 * ends + ends[:, ::-1]) / 3


def _apart(made: Floats, *pieces: Floats) -> Floats:
    """Largest distance of points of ``pieces`` from the cubics ``made``, about; all (cubic, 4, 2)."""
    t = np.linspace(0, 1, 17)[:, None]
    samples = np.concatenate([points_at(piece, t[1:-1:2]) for piece in pieces], axis=1)
    found = []
    for first in range(0, len(made), AT_ONCE):
        curve = points_at(made[first : first + AT_ONCE], t)[:, None]
        ways = np.diff(curve, axis=2)
        behind = samples[first : first + AT_ONCE, :, None] - curve[:, :, :-1]
        along = (behind * ways).sum(axis=3) / np.maximum((ways**2).sum(axis=3), 1e-12)
        apart = behind - np.clip(along, 0, 1)[..., None] * ways
        found.append(np.linalg.norm(apart, axis=3).min(axis=2).max(axis=1))
    return np.concatenate(found)
