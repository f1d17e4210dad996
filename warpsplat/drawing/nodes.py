"""Candidates for simpler outlines: fewer, straighter or more upright pieces.

All are found at once, as arrays. How much each costs is told by what the image says of the outlines
(``drawing.tidy``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.constraints import SAME_COORDINATE, Drawing, Flags, Floats, Links, with_ends
from warpsplat.drawing.merge import handles_through
from warpsplat.scene.attributes import Joint

LEVEL_SLOPE = 0.06  # slope below which a line, or a tangent, may be made level or upright
CUBIC_BYTES, LINE_BYTES, HANDLES_BYTES, NUMBER_BYTES = 19, 7, 12, 3
"""Bytes of a cubic, a line, the handles of a cubic and a number in a file."""

WITHOUT, STRAIGHT, LEVEL, TANGENT = range(4)
"""Kinds: a piece for the two that meet in a point, a line for a cubic, a level or upright line, and such a
tangent of a smooth joint."""


@dataclass(frozen=True)
class Edits:
    """Changes of a drawing, each of the piece, or of the point, where a cubic begins."""

    kind: npt.NDArray[np.intp]
    """Shape (edit,), as all."""
    at: Links
    """The cubic; ``WITHOUT`` makes it part of the one before."""
    handles: Floats
    """Handles of the piece that an edit makes, shape (edit, 2, 2); unused by others."""
    axis: npt.NDArray[np.intp]
    """The coordinate that a line or a tangent has in common."""
    value: Floats
    """Where a level line lies."""
    saved: npt.NDArray[np.intp]
    """Bytes."""
    around: Links
    """The cubics that it may change, shape (edit, 4); fewer are repeated."""

    def take(self, chosen: npt.NDArray[np.integer] | Flags) -> Edits:
        """Return the ``chosen`` ones."""
        return Edits(**{name: values[chosen] for name, values in vars(self).items()})


class Outlines:
    """A drawing's outlines by the cubics."""

    def __init__(self, drawing: Drawing) -> None:
        self._drawing = drawing
        self._next = drawing.following()
        self._previous = np.empty_like(self._next)
        self._previous[self._next] = np.arange(len(self._next))
        self._line = drawing.lines()
        self._points = drawing.scene.points.astype(np.float64).reshape(-1, 3, 2)
        self._smooth = drawing.joints[::3] == Joint.SMOOTH

    def edits(self, refused: Flags) -> Edits:
        """Return all candidates but the ``refused`` ones, by cubic and kind, shape (cubic, 4)."""
        found = [self._merged(~refused[:, WITHOUT]), self._straight(), self._level(), self._leaning()]
        names = vars(found[0])
        edits = Edits(**{name: np.concatenate([vars(part)[name] for part in found]) for name in names})
        return edits.take(~refused[edits.at, edits.kind])

    def _edits(self, kind: int, at: Links, saved: npt.NDArray[np.intp] | int, **known: Any) -> Edits:
        before, after = self._previous[at], self._next[at]
        far = self._previous[before] if kind == WITHOUT else before
        values: dict[str, Any] = {
            "handles": np.zeros((len(at), 2, 2)),
            "axis": np.zeros(len(at), np.intp),
            "value": np.zeros(len(at)),
            **known,
        }
        around = np.stack([far, before, at, at if kind == TANGENT else after], axis=1)
        saved = np.broadcast_to(np.asarray(saved, np.intp), at.shape)
        return Edits(np.full(len(at), kind), at, saved=saved, around=around, **values)

    def _merged(self, wanted: Flags) -> Edits:
        """Return the ``wanted`` points that can go: those of outlines with three pieces or more."""
        at = np.flatnonzero(wanted & (self._next[self._next] != self._previous))
        at = at[self._next[self._next[at]] != at]
        before = self._previous[at]
        cubics = with_ends(self._points, self._next)
        first, second = cubics[before], cubics[at]
        whole = np.stack([first[:, 0], second[:, 3]], axis=1)
        lines = self._line[before].astype(np.intp) + self._line[at]
        handles = np.where((lines == 2)[:, None, None], thirds_between(whole), handles_through(first, second))
        return self._edits(WITHOUT, at, np.where(lines > 0, LINE_BYTES, CUBIC_BYTES), handles=handles)

    def _straight(self) -> Edits:
        at = np.flatnonzero(~self._line)
        ends = np.stack([self._points[at, 0], self._points[self._next[at], 0]], axis=1)
        return self._edits(STRAIGHT, at, HANDLES_BYTES, handles=thirds_between(ends))

    def _level(self) -> Edits:
        """Return the lines that are nearly level or upright, unless both ends are held by others."""
        on, after = self._points[:, 0], self._points[self._next, 0]
        offsets = np.abs(after - on)
        off, axis = offsets.min(axis=1), offsets.argmin(axis=1)
        near = self._line & (off >= SAME_COORDINATE) & (off <= LEVEL_SLOPE * offsets.max(axis=1))
        canvas = self._drawing.scene.canvas
        size = np.array([canvas.width, canvas.height])
        held = np.minimum(np.abs(on), np.abs(on - size)) < SAME_COORDINATE
        level = self._line[:, None] & (offsets < SAME_COORDINATE)
        held |= level | level[self._previous]
        at = np.flatnonzero(near)
        ends = np.stack([at, self._next[at]], axis=1)
        fixed = held[ends, axis[at][:, None]]
        values = self._points[ends, 0, axis[at][:, None]]
        value = np.where(fixed[:, 0], values[:, 0], np.where(fixed[:, 1], values[:, 1], values.mean(axis=1)))
        found = self._edits(LEVEL, at, NUMBER_BYTES, axis=axis[at], value=value)
        return found.take(~fixed.all(axis=1))

    def _leaning(self) -> Edits:
        """Return the smooth joints of cubics whose tangents are nearly level or upright."""
        before = self._previous
        at = np.flatnonzero(self._smooth & ~self._line & ~self._line[before])
        handles = np.stack([self._points[before[at], 2], self._points[at, 1]], axis=1)
        offsets = np.abs(handles - self._points[at, :1])
        axis = offsets.sum(axis=1).argmin(axis=1)
        across = np.take_along_axis(offsets, axis[:, None, None], axis=2)[..., 0]
        along = np.take_along_axis(offsets, 1 - axis[:, None, None], axis=2)[..., 0]
        near = (across.max(axis=1) >= SAME_COORDINATE) & (across <= LEVEL_SLOPE * along).all(axis=1)
        return self._edits(TANGENT, at[near], NUMBER_BYTES, axis=axis[near])


def applied(drawing: Drawing, edits: Edits) -> tuple[Drawing, Flags]:
    """Return the drawing after ``edits`` that have no cubics in common, and which cubics are left."""
    points = drawing.scene.points.astype(np.float64).reshape(-1, 3, 2)
    joints = drawing.joints.reshape(-1, 3).copy()
    following, line = drawing.following(), drawing.lines()
    previous = np.empty_like(following)
    previous[following] = np.arange(len(following))

    def of(kind: int) -> Edits:
        return edits.take(edits.kind == kind)

    gone = of(WITHOUT)
    before = previous[gone.at]
    points[before, 1:] = gone.handles
    both = line[gone.at] & line[before]
    joints[before, 1:] = np.where(both, Joint.LINE_HANDLE, Joint.FREE)[:, None]
    made = of(STRAIGHT)
    points[made.at, 1:], joints[made.at, 1:] = made.handles, Joint.LINE_HANDLE
    joints[made.at[line[previous[made.at]]], 0] = Joint.CORNER
    after = following[made.at]
    joints[after[line[after]], 0] = Joint.CORNER
    level = of(LEVEL)
    for end in (level.at, following[level.at]):
        points[end, 0, level.axis] = level.value
    leaning = of(TANGENT)
    value = points[leaning.at, 0, leaning.axis]
    points[leaning.at, 1, leaning.axis] = value
    points[previous[leaning.at], 2, leaning.axis] = value
    keep = np.ones(len(points), np.bool_)
    keep[gone.at] = False
    scene = replace(drawing.scene, points=points.reshape(-1, 2).astype(np.float32))
    every = np.repeat(keep, 3)
    return Drawing(scene.without_points(every), joints.reshape(-1)[every]), keep


def apart(edits: Edits, cost: Floats) -> Links:
    """Choose the edits with the least ``cost`` that have no cubics in common; return their indices."""
    rank = np.empty(len(cost), np.intp)
    rank[np.argsort(cost, kind="stable")] = np.arange(len(cost))
    count = int(edits.around.max(initial=-1)) + 1
    taken, left = np.zeros(count, np.bool_), np.arange(len(cost))
    chosen = []
    while len(left):
        around = edits.around[left]
        least = np.full(count, len(cost))
        np.minimum.at(least, around.ravel(), np.repeat(rank[left], around.shape[1]))
        first = left[(least[around] == rank[left][:, None]).all(axis=1)]
        chosen.append(first)
        taken[edits.around[first]] = True
        left = left[~taken[around].any(axis=1)]
    return np.concatenate(chosen) if chosen else np.zeros(0, np.intp)


def thirds_between(ends: Floats) -> Floats:
    """Return the points at the thirds of lines, shape (line, 2, 2), between ``ends`` of the same shape."""
    return (2 * ends + ends[:, ::-1]) / 3
