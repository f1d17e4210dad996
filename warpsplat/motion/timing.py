"""Choose the frames of an animation."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from warpsplat.portable.elementary import power

SECONDS = 6.0
"""Default duration of the movement [s]."""

SHORTEST, LONGEST = 0.5, 60.0
"""Limits of the duration [s]."""

HOLD = 2.0
"""Time that the last frame stays before the loop restarts [s]."""

EARLY = 1.5
"""Exponent from the fraction of the animation to that of the run: early changes are larger."""


@dataclass(frozen=True)
class Showing:
    """A frame of an animation."""

    index: int
    """Index of the scene."""
    seconds: float
    """Duration [s]."""


def showings(moments: Sequence[int], ticks: int, seconds: float) -> list[Showing]:
    """Return the frames that show a run in ``seconds`` of ``ticks`` equal parts.

    Early ones are shown longer; late ones are skipped where there are more than parts.

    Args:
        moments: when the pictures were, counted in reports of the run, ascending.
        ticks: parts.
        seconds: in all.
    """
    found: list[Showing] = []
    for tick in range(ticks if moments else 0):
        now = (moments[-1] + 1) * float(power((tick + 0.5) / ticks, EARLY))
        index = max(0, bisect_right(moments, now) - 1)
        if found and found[-1].index == index:
            found[-1] = Showing(index, found[-1].seconds + seconds / ticks)
        else:
            found.append(Showing(index, seconds / ticks))
    return found


def kept(moments: Sequence[int], most: int) -> list[int]:
    """Return the indices of ``most`` scenes to keep: those an animation would show, with both ends."""
    chosen = {showing.index for showing in showings(moments, most - 2, 1.0)}
    return sorted(chosen | {0, len(moments) - 1})
