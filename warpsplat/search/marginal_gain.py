"""Where a curve that rises ever more slowly has its knee."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def knee(cost: Floats, gain: Floats) -> int | None:
    """The point that lies furthest above the chord from the first to the last one: that is where the curve is
    as steep as it is on the average. Before it a unit of cost buys more than that, behind it less.

    This is the knee of Satopää et al. 2011 ("Finding a Kneedle in a Haystack") of a curve that is smooth.

    Args:
        cost: ascending, shape (point,).
        gain: at these, in any unit, shape (point,).

    Returns:
        its index; None where no point lies above the chord, as of fewer than three.
    """
    if len(cost) < 3 or gain[-1] <= gain[0]:
        return None
    across = (cost - cost[0]) / (cost[-1] - cost[0])
    above = (gain - gain[0]) / (gain[-1] - gain[0]) - across
    best = int(above.argmax())
    return best if above[best] > LEAST and 0 < best < len(cost) - 1 else None


LEAST = 1e-6
"""Height over the chord, in shares of the whole gain, that is no accident of rounding."""
