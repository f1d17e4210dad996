"""Contours that do not cross themselves: what would make one do so is refused."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.constraints import Constraints, Drawing, Flags, Floats, Links, rows_of, with_ends
from warpsplat.kernels.drawing import crossings as kernels
from warpsplat.rendering.program import launch_on_host

PIECES = 7
"""Lines that take the place of a cubic; an odd number, as what is symmetric crosses halfway."""

ROUNDS = 7
"""Times that more and more of a step is taken back; at last whole contours stay as they were."""


def crossing(cubics: Floats, following: Links, contour: Links, chosen: Flags | None = None) -> Flags:
    """Return which cubics, shape (cubic, 4, 2), cross others of their contours, or themselves.

    ``following``, ``contour``: as ``Drawing`` has them; ``chosen``: where to look, whole contours.
    """
    count = len(cubics)
    lines, low, high = np.zeros((count, PIECES + 1, 2)), np.zeros((count, 2)), np.zeros((count, 2))
    made = {"points": lines, "low": low, "high": high}
    launch_on_host(kernels.flatten, count, made, cubics=rows_of(cubics))
    order = np.lexsort((low[:, 0], contour))
    order = order if chosen is None else order[chosen[order]]
    ends = np.cumsum(np.bincount(contour[order], minlength=int(contour.max(initial=0)) + 1))[contour[order]]
    found = np.zeros(count, np.int32)
    values = {"order": order, "end": ends, "following": following, "found": found}
    launch_on_host(kernels.crossings, len(order), made, values)
    return found > 0


class Crossings:
    """Keeps the contours of a drawing from crossing themselves."""

    def __init__(self, drawing: Drawing, points: Floats) -> None:
        """``points``: where the outlines are, shape (point, 2); what crosses there may go on to do so."""
        self._before, self._next = drawing.neighbours()
        self._contour = drawing.contour()
        self._were = np.zeros(len(self._contour), np.bool_)
        self._were = self.new(points)

    def new(self, points: Floats, chosen: Flags | None = None) -> Flags:
        """Return those that did not cross at first, of the ``chosen`` cubics."""
        cubics = with_ends(points, self._next)
        return crossing(cubics, self._next, self._contour, chosen) & ~self._were

    def refuse(self, before: Floats, after: Floats, constraints: Constraints) -> tuple[Floats, Flags]:
        """Return ``after``, but with ``before`` where a contour would begin to cross, and these cubics.

        Half of the way is tried first; then more and more around these is taken back until nothing crosses.
        """
        refused, points, old = np.zeros(len(self._contour), np.bool_), after, before.reshape(-1, 3, 2)
        crosses = self.new(after)
        for done in range(ROUNDS):
            if not crosses.any():
                break
            own = np.bincount(self._contour, crosses)[self._contour] > 0
            around = own if done + 1 == ROUNDS else crosses
            for _ in range((1 << done) // 2):
                around = around | around[self._before] | around[self._next]
            refused = refused | around
            back, (first, last) = after.reshape(-1, 3, 2).copy(), (self._before[refused], self._next[refused])
            kept = 0.5 * (old + back) if done == 0 else old
            back[refused], back[first, 2], back[last, :2] = kept[refused], kept[first, 2], kept[last, :2]
            points = constraints.project(back.reshape(-1, 2))
            crosses = self.new(points, own)
        return points, refused
