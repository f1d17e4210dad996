"""One cubic in place of two."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.constraints import Floats, rows_of
from warpsplat.kernels.drawing import join
from warpsplat.rendering.program import launch_on_host

SAMPLES_PER_CUBIC = 12  # of each of the two cubics
FITTING_ROUNDS = 4  # of fitting handles and finding the samples' places along the cubic


def handles_through(first: Floats, second: Floats) -> Floats:
    """Return the handles of the cubics nearest to two that follow one another, shape (..., 2, 2).

    They begin and end where those do, in the same directions; the lengths are fitted by least squares.

    ``first`` and ``second``, which begins where ``first`` ends, have shape (..., 4, 2).
    """
    cubics = rows_of(np.concatenate([first, second], axis=-2))
    count, samples = len(cubics) // 8, 2 * SAMPLES_PER_CUBIC
    made = np.zeros((4 * count, 2))
    launch_on_host(
        join.handles_through,
        count,
        cubics=cubics,
        samples=SAMPLES_PER_CUBIC,
        rounds=FITTING_ROUNDS,
        place=np.zeros((count, samples, 2)),
        t=np.zeros((count, samples)),
        made=made,
    )
    return made.reshape(*first.shape)[..., 1:3, :]
