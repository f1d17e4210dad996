"""Points of cubic Béziers, and where on them other points are nearest."""

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


def distance_derivatives(cubics: Floats, points: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Return the first two derivatives, by ``t``, of half the squared distances of cubics from points.

    Args:
        cubics: Shape (..., 4, 2).
        points: Shape (..., sample, 2).
        t: Where on the cubics, shape (..., sample).
    """
    slopes = 3 * np.diff(cubics, axis=-2)
    bends = 2 * np.diff(slopes, axis=-2)
    s = 1 - t
    away = points_at(cubics, t) - points
    first, second = np.zeros_like(t), np.zeros_like(t)
    for axis in (0, 1):
        slope, bend, off = slopes[..., axis, None], bends[..., axis, None], away[..., axis]
        speed = s * s * slope[..., 0, :] + 2 * s * t * slope[..., 1, :] + t * t * slope[..., 2, :]
        first += off * speed
        second += speed * speed + off * (s * bend[..., 0, :] + t * bend[..., 1, :])
    return first, second
