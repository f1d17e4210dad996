"""Polylines, many at once, by their arc lengths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.portable.sequences import interp


def arc_lengths(points: Floats, *, closed: bool = False) -> Floats:
    """Return the arc length at each point (point, 2) and, of a closed polyline, that of the whole at last."""
    following = np.roll(points, -1, axis=0) if closed else points[1:]
    steps = hypot(*(following - points[: len(following)]).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


class Polylines:
    """Several polylines."""

    def __init__(self, parts: Sequence[Floats], closed: Sequence[bool]) -> None:
        """Take polylines of points (point, 2), of which a closed one does not repeat its first."""
        along = [arc_lengths(part, closed=ring) for part, ring in zip(parts, closed, strict=True)]
        self.closed = np.asarray(closed, np.bool_)
        self.totals = np.array([lengths[-1] for lengths in along])
        """The length of each [px], shape (polyline,)."""
        # One after the other, with gaps between them.
        self._begins = np.cumsum(self.totals + 1) - self.totals
        shifted = [lengths + begin for lengths, begin in zip(along, self._begins, strict=True)]
        self._along = np.concatenate([*shifted, np.zeros(0)])
        rings = [np.concatenate([part, part[: int(ring)]]) for part, ring in zip(parts, closed, strict=True)]
        self._points = np.concatenate([*rings, np.zeros((0, 2))])

    def at(self, which: Ints, where: Floats) -> Floats:
        """Return points at arc lengths, shape (..., 2); of a closed polyline modulo its length.

        Args:
            which: Numbers of polylines, any shape.
            where: Arc lengths, a shape that ``which`` is broadcast to.
        """
        total = self.totals[which]
        around = where % np.where(total > 0, total, 1.0)
        where = np.where(self.closed[which], around, np.clip(where, 0, total))
        return interp(where + self._begins[which], self._along, self._points)
