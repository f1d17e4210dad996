"""When an animation shows what."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from warpsplat.portable.elementary import power

SECONDS = 6.0
"""Of an animation's movement, where it is not said."""

SHORTEST, LONGEST = 0.5, 60.0
"""Of what may be said [s]."""

HOLD = 2.0
"""The finished picture stays, before a loop begins again [s]."""

EARLY = 1.5
"""Power of a share of the animation that is the share of the run: much changes early, little late."""


@dataclass(frozen=True)
class Showing:
    """One picture of an animation."""

    index: int
    """Of the pictures that there are."""
    seconds: float
    """How long it is shown."""


def showings(moments: Sequence[int], ticks: int, seconds: float) -> list[Showing]:
    """Which pictures of a run ``seconds`` of ``ticks`` equal parts show.

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
    """Indices of those pictures of a run that goes on that are kept where there is room for ``most``: those
    that would be shown, the first and the last one among them.
    """
    chosen = {showing.index for showing in showings(moments, most - 2, 1.0)}
    return sorted(chosen | {0, len(moments) - 1})
