"""Polylines by their arc lengths."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import hypot


def arc_lengths(points: Floats, *, closed: bool = False) -> Floats:
    """Return the arc length at each point (point, 2) and, of a closed polyline, that of the whole at last."""
    following = np.roll(points, -1, axis=0) if closed else points[1:]
    steps = hypot(*(following - points[: len(following)]).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def at_length(points: Floats, along: Floats, closed: bool, where: Floats) -> Floats:
    """Return points at arc lengths, shape (..., 2); of a closed polyline modulo its length.

    Args:
        points: Shape (point, 2).
        along: Their arc lengths.
        closed: Whether the last point joins the first.
        where: Arc lengths, shape (...).
    """
    ring = np.concatenate([points, points[:1]]) if closed else points
    where = where % along[-1] if closed else np.clip(where, 0, along[-1])
    low = np.clip(np.searchsorted(along, where, side="right") - 1, 0, len(along) - 2)
    size = np.diff(along)
    share = (where - along[low]) / np.where(size > 0, size, 1.0)[low]
    return np.asarray(ring[low] + share[..., None] * np.diff(ring, axis=0)[low])
