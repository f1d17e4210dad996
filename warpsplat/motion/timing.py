"""When an animation shows what."""

from __future__ import annotations

from dataclasses import dataclass

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


def showings(count: int, ticks: int, seconds: float) -> list[Showing]:
    """Which of ``count`` pictures, in the order of the run, ``seconds`` of ``ticks`` equal parts show.

    Early ones are shown longer; late ones are skipped where there are more than parts.
    """
    found: list[Showing] = []
    for tick in range(ticks if count else 0):
        index = int(count * ((tick + 0.5) / ticks) ** EARLY)
        if found and found[-1].index == index:
            found[-1] = Showing(index, found[-1].seconds + seconds / ticks)
        else:
            found.append(Showing(index, seconds / ticks))
    return found


def kept(count: int, most: int) -> list[int]:
    """Which of ``count`` pictures of a run that goes on are kept where there is room for ``most``: as they
    will be shown, the last one among them.
    """
    chosen = {showing.index for showing in showings(count, most - 1, 1.0)}
    return sorted(chosen | {count - 1})
