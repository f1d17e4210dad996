"""Polylines, many at once, by their arc lengths."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.scene.scene import starts_of


def arc_lengths(points: Floats, *, closed: bool = False) -> Floats:
    """Return the arc length at each point (point, 2) and, of a closed polyline, that of the whole at last."""
    following = np.roll(points, -1, axis=0) if closed else points[1:]
    steps = hypot(*(following - points[: len(following)]).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True)
class Polylines:
    """Polylines, one after the other; of a closed one, the first point comes again at the end."""

    points: Floats
    """Shape (point, 2)."""
    first: Ints
    """First point of each and, last, the number of points, shape (polyline + 1,)."""
    closed: Bools
    """Shape (polyline,)."""

    along: Floats
    """The arc length at each point, from the first of its polyline; shape (point,)."""

    @staticmethod
    def of(points: Floats, first: Ints, closed: Bools) -> Polylines:
        """Return polylines with their arc lengths."""
        steps = np.concatenate([hypot(*np.diff(points, axis=0).T), [0.0]])[: len(points)]
        along = np.zeros(len(points))
        # One by one, so that no polyline's rounding depends on another.
        for low, high in itertools.pairwise(first.tolist()):
            np.cumsum(steps[low : high - 1], out=along[low + 1 : high])
        return Polylines(points, first, closed, along)

    @staticmethod
    def joined(parts: Sequence[Floats], closed: Sequence[bool]) -> Polylines:
        """Return polylines of points (point, 2), of which a closed one does not repeat its first."""
        rings = [
            np.concatenate([part, part[:1]]) if ring else part
            for part, ring in zip(parts, closed, strict=True)
        ]
        first = starts_of(np.array([len(part) for part in rings], np.int64))
        return Polylines.of(np.concatenate([*rings, np.zeros((0, 2))]), first, np.asarray(closed, np.bool_))

    def and_also(self, others: Polylines) -> Polylines:
        """Return these polylines and then others."""
        return Polylines(
            np.concatenate([self.points, others.points]),
            np.concatenate([self.first, others.first[1:] + self.first[-1]]),
            np.concatenate([self.closed, others.closed]),
            np.concatenate([self.along, others.along]),
        )

    def __len__(self) -> int:
        return len(self.closed)

    @cached_property
    def totals(self) -> Floats:
        """The length of each [px], shape (polyline,)."""
        return np.asarray(self.along[self.first[1:] - 1])

    @cached_property
    def counts(self) -> Ints:
        """The number of different points of each, shape (polyline,)."""
        return np.diff(self.first) - self.closed

    @cached_property
    def _bases(self) -> Floats:
        """Offsets with which the arc lengths of all polylines ascend, shape (polyline,)."""
        return np.concatenate([[0.0], np.cumsum(self.totals + 1)])[:-1]

    @cached_property
    def _keys(self) -> Floats:
        return self.along + np.repeat(self._bases, np.diff(self.first))

    def points_until(self, which: Ints, where: Floats) -> Ints:
        """Return how many points have an arc length of at most ``where``, shape (n,).

        Args:
            which: Numbers of polylines, shape (n,).
            where: Arc lengths, shape (n,).
        """
        first, end = self.first[which], self.first[which + 1]
        found = np.searchsorted(self._keys, where + self._bases[which], side="right")
        found = np.clip(found, first, end)
        # The bases round.
        found -= (found > first) & (self.along[found - 1] > where)
        found += (found < end) & (self.along[np.minimum(found, end - 1)] <= where)
        return found - first

    def at(self, which: Ints, where: Floats) -> Floats:
        """Return points at arc lengths, shape (n, 2); of a closed polyline modulo its length.

        Args:
            which: Numbers of polylines, shape (n,).
            where: Arc lengths, shape (n,).
        """
        total = self.totals[which]
        divisor = np.where(total > 0, total, 1.0)
        where = np.where(self.closed[which], where % divisor, np.clip(where, 0, total))
        low = self.first[which] + self.points_until(which, where) - 1
        low = np.minimum(low, self.first[which + 1] - 2)
        size = self.along[low + 1] - self.along[low]
        share = (where - self.along[low]) / np.where(size > 0, size, 1.0)
        start = self.points[low]
        return np.asarray(start + share[:, None] * (self.points[low + 1] - start))
