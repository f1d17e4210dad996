"""When an animation shows what."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from warpsplat.portable.elementary import power

DEFAULT_SECONDS = 6.0
"""Duration of an animation's movement [s]."""

MIN_SECONDS, MAX_SECONDS = 0.5, 60.0

HOLD = 2.0
"""Time that the finished picture is shown before a loop starts again [s]."""


def showings(moments: Sequence[int], ticks: int, seconds: float) -> dict[int, float]:
    """Return which recorded pictures an animation shows, by index, and how long each [s].

    Late ones are skipped if there are more than ``ticks``, equal parts of the animation.

    ``moments``: when the pictures were recorded, as numbers of progress reports, ascending; ``seconds``:
    duration.
    """
    found: dict[int, float] = {}
    early = 1.5  # share of the run = share of the animation to this power: much changes early, little late
    for tick in range(ticks if moments else 0):
        now = (moments[-1] + 1) * float(power((tick + 0.5) / ticks, early))
        index = max(0, bisect_right(moments, now) - 1)
        found[index] = found.get(index, 0.0) + seconds / ticks
    return found


def kept(moments: Sequence[int], most: int) -> list[int]:
    """Return the indices of at most ``most`` pictures: those that would be shown, the first and the last."""
    return sorted({*showings(moments, most - 2, 1.0), 0, len(moments) - 1})
