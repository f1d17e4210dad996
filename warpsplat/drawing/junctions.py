"""Strokes that end at others end on their centre lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.beziers import from_parameter, points_at
from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Scene
from warpsplat.svg.data import cubic_rows

SHARES = np.linspace(0, 1, 33)  # of a cubic, between which it is taken for straight


def with_junctions(strokes: Scene) -> Scene:
    """Return strokes, of one contour each, of which those that end in the ink of others end on centre lines.

    Each is lengthened or shortened along its end, by no more than twice the width of the other.
    """
    points, rows = strokes.points.astype(np.float64), cubic_rows(strokes)
    first = strokes.first.astype(np.intp)
    widths = strokes.widths.astype(np.float64)[np.searchsorted(first, rows[:, 0], "right") - 1]
    reach = 0.5 * widths[:, None]
    low, high = points[rows].min(axis=1) - reach, points[rows].max(axis=1) + reach
    for stroke in np.flatnonzero(strokes.closed == 0).tolist():
        last = int(first[stroke + 1]) - 1
        for end, toward in ((int(first[stroke]), 1), (last, -1)):
            near = np.flatnonzero(((low <= points[end]) & (points[end] <= high)).all(axis=1))
            near = near[(rows[near, 0] != end) & (rows[near, 3] != end)]  # a cubic cannot end on itself
            shift = _shift(points, rows[near], widths[near], end, toward)
            if shift.any():
                own = slice(end, end + 4) if toward > 0 else slice(end - 3, end + 1)
                points[own][::toward] = _extended(points[own][::toward], shift)
    return replace(strokes, points=points.astype(np.float32))


def _shift(points: Floats, rows: Floats, widths: Floats, end: int, toward: int) -> Floats:
    """Return how far the end of a stroke is, along it, from the nearest centre line in whose ink it lies."""
    here, none = points[end], np.zeros(2)
    inner = points[[end + toward, end + 2 * toward, end + 3 * toward]]
    away = hypot(*(here - inner).T)
    if not len(rows) or away.max() < 1e-6:
        return none
    way = (here - inner[away > 1e-6][0]) / away[away > 1e-6][0]
    lines = points_at(points[rows], SHARES) - here
    in_ink = _distances(lines) <= widths / 2
    lines, most = lines[in_ink], 2 * widths[in_ink][:, None]
    beside = lines[..., 1] * way[0] - lines[..., 0] * way[1]
    ahead = (lines * way).sum(axis=2)
    before, after = beside[:, :-1], beside[:, 1:]
    crosses = (before * after <= 0) & (before != after)
    share = before / np.where(crosses, before - after, 1)
    met = ahead[:, :-1] + share * np.diff(ahead, axis=1)
    found: Floats = met[crosses & (np.abs(met) <= most)]
    return found[np.abs(found).argmin()] * way if len(found) else none


def _extended(cubic: Floats, shift: Floats) -> Floats:
    """Return a cubic (4, 2) that goes on as it does, but begins elsewhere, at a point along its beginning."""
    ways = np.stack([3 * (cubic[1] - cubic[0]), cubic[3] - cubic[0]])  # of which one is 0 at sharp beginnings
    way = ways[hypot(*ways.T).argmax()]
    t = float((shift * way).sum() / max(float((way * way).sum()), 1e-12))
    made = from_parameter(cubic, min(max(t, -1.0), 1.0))
    made[0] = cubic[0] + shift
    return made


def _distances(lines: Floats) -> Floats:
    """Return the distances of polylines (line, point, 2) from the origin, shape (line,)."""
    start, step = lines[:, :-1], np.diff(lines, axis=1)
    share = np.clip(-(start * step).sum(axis=2) / np.maximum((step * step).sum(axis=2), 1e-12), 0, 1)
    nearest = start + share[..., None] * step
    return np.asarray(hypot(nearest[..., 0], nearest[..., 1]).min(axis=1))
