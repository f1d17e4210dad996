"""Points of cubic Béziers."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats


def points_at(cubics: Floats, t: Floats) -> Floats:
    """Return points of cubics, shape (..., 4, 2), at ``t``, shape (..., sample); shape (..., sample, 2)."""
    s = 1 - t
    weights = s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t
    return np.stack(
        [sum(w * cubics[..., k, axis, None] for k, w in enumerate(weights)) for axis in (0, 1)], axis=-1
    )
