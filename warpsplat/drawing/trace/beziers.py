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


def from_parameter(cubic: Floats, t: float) -> Floats:
    """Return a cubic (4, 2) from a parameter to its end; from below 0 it goes on before its beginning."""
    first = cubic[:-1] + t * np.diff(cubic, axis=0)
    second = first[:-1] + t * np.diff(first, axis=0)
    return np.stack([second[0] + t * (second[1] - second[0]), second[1], first[2], cubic[3]])
