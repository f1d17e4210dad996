"""The knee of a curve that rises ever more slowly (Satopää et al. 2011)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def knee(cost: Floats, gain: Floats) -> int | None:
    """Return the index of the point farthest above the chord from the first to the last point.

    There the curve is as steep as on average: before it a unit of cost buys more, after it less.

    Args:
        cost: ascending, shape (point,).
        gain: at these costs, in any unit, shape (point,).

    Returns:
        the index; None if no point lies above the chord.
    """
    if len(cost) < 3 or gain[-1] <= gain[0]:
        return None
    across = (cost - cost[0]) / (cost[-1] - cost[0])
    above = (gain - gain[0]) / (gain[-1] - gain[0]) - across
    best = int(above.argmax())
    return best if above[best] > LEAST and 0 < best < len(cost) - 1 else None


LEAST = 1e-6
"""Least height over the chord, as a share of the whole gain: less is rounding."""
