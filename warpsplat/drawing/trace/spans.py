"""Parts of outlines, cut at their corners, with the places where curves may begin and end."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.corners import find_corners
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.polylines import arc_lengths
from warpsplat.portable.elementary import hypot

FINE_TOLERANCE = 0.3  # [px] up to which corners are looked for at their finest scale
BENT = 1.0  # [px] of outline beside a corner that its antialiasing bends
SPACING, MOST_KNOTS = 1.5, 48  # [px] between knots, about; and how many a span has, at the most
WINDOW = 4.0  # [px] of outline on each side of a knot that tells its place and tangent
END_WEIGHT = 16.0  # of a corner or junction, which is known exactly
RANK = 1e-24  # what is left of a sum of squares, over the whole, that counts as 0


@dataclass(frozen=True)
class Polyline:
    """A part of an outline, to be fitted."""

    points: Floats
    """Shape (point, 2)."""
    closed: bool
    start: Floats | None = None
    """Where an open one begins, shape (2,)."""
    end: Floats | None = None
    is_polygon: bool = False
    """Whether the points are corners."""


@dataclass(frozen=True)
class Span:
    """A part of a run between two corners, or a smooth ring."""

    points: Floats
    """Shape (point, 2); of a ring the last is the first."""
    knots: Floats
    """Where one curve may end and the next begin, shape (knot, 2)."""
    tangents: Floats
    """Unit vectors there, shape (knot, 2)."""
    places: Ints
    """Index of the point at each knot, shape (knot,)."""


def cut_at_corners(run: Polyline, tolerance: float) -> list[Span]:
    """Return the spans of a run.

    Args:
        run: No polygon.
        tolerance: Of the curves that are to be fitted [px]; for coarser ones corners are broader.
    """
    points = run.points
    if not run.closed:
        assert run.start is not None and run.end is not None
        points = np.concatenate([run.start[None], points, run.end[None]])
        keep = np.concatenate([[True], hypot(*np.diff(points, axis=0).T) > 1e-6])
        points = points[keep] if keep.sum() > 1 else points[:2]
    scale = max(1.0, tolerance / FINE_TOLERANCE)
    corners = find_corners(points, run.closed, scale) if len(points) > 4 else []
    if run.closed and not corners:
        ring = np.roll(points, -int(points[:, 0].argmin()), axis=0)  # begun where it goes straight up or down
        return [_with_knots(np.concatenate([ring, ring[:1]]), closed=True)]
    along = arc_lengths(points, closed=run.closed)
    total = float(along[-1])
    if run.closed:
        stops = [*corners, (corners[0][0] + total, corners[0][1])]
        along = np.concatenate([along[:-1], along[:-1] + total])
        points = np.concatenate([points, points])
    else:
        stops = [(0.0, points[0]), *corners, (total, points[-1])]
    spans = []
    for (low, first), (high, last) in itertools.pairwise(stops):
        after = BENT if run.closed or low > 0 else 1e-6
        before = BENT if run.closed or high < total else 1e-6
        inner = points[(along > low + after) & (along < high - before)]
        spans.append(_with_knots(np.concatenate([first[None], inner, last[None]])))
    return spans


def _with_knots(points: Floats, closed: bool = False) -> Span:
    """Return the span of points, of which a ring's last is its first."""
    along = arc_lengths(points)
    total = float(along[-1])
    wanted = np.linspace(0, total, int(np.clip(total / SPACING, 1, MOST_KNOTS)) + 1)
    right = np.clip(np.searchsorted(along, wanted), 1, len(along) - 1)
    places = np.unique(right - (wanted - along[right - 1] < along[right] - wanted))
    if len(places) < 2:
        places = np.array([0, len(points) - 1])
    knots, tangents = _smoothed(points[:-1] if closed else points, along, places, closed)
    if closed:
        knots[-1], tangents[-1] = knots[0], tangents[0]
    else:
        knots[0], knots[-1] = points[0], points[-1]
    return Span(points, knots, tangents, places)


def _smoothed(ring: Floats, along: Floats, places: Ints, closed: bool) -> tuple[Floats, Floats]:
    """Return where an outline passes at ``places``, and its directions, by parabolas through points nearby.

    Args:
        ring: Points, shape (point, 2).
        along: Their arc lengths; of a closed outline with its length at last.
        places: Indices of points.
        closed: Whether the last point joins the first.
    """
    total, here, count = float(along[-1]), along[places], len(ring)
    along = along[:count]
    window, first = WINDOW, 0
    weights = np.where((along == 0) | (along == total), END_WEIGHT, 1.0)
    if closed:
        window, first, weights = min(WINDOW, 0.5 * total), count, np.ones(count)
        along = np.concatenate([along - total, along, along + total])
    beside = np.arange(min(5, len(along))) + np.clip(places[:, None] + first - 2, 0, max(len(along) - 5, 0))
    third = np.sort(np.abs(along[beside] - here[:, None]), axis=1)[:, min(2, len(along) - 1)]
    reach = np.maximum(window, third + 1e-9)  # so that rounding does not leave the third out
    low, high = np.searchsorted(along, here - reach), np.searchsorted(along, here + reach, side="right")
    counts = np.minimum(high - low, count)
    # The points near all places as one array, filled up with points that have no weight.
    number = np.arange(counts.max())
    columns = np.minimum(low[:, None] + number, len(along) - 1)
    t = along[columns] - here[:, None]
    columns %= count
    weights = weights[columns] * (number < counts[:, None])
    is_curved = (counts > 4) & (along[low + counts - 1] - along[low] > 2)
    middles, slopes = _parabolas(t, weights, is_curved, ring[columns])
    size = hypot(*slopes.T)
    still = size < 1e-9
    slopes[still] = (ring[np.minimum(places + 1, count - 1)] - ring[places - 1])[still]
    size = np.where(still, hypot(*slopes.T), size)
    return middles, slopes / np.maximum(size, 1e-9)[:, None]


def _parabolas(t: Floats, weights: Floats, is_curved: Bools, points: Floats) -> tuple[Floats, Floats]:
    """Fit parabolas, or lines where not ``is_curved``, by least squares with orthogonal polynomials of ``t``.

    Args:
        t: Of the points, shape (place, point).
        weights: Of the squared errors, shape (place, point).
        is_curved: Shape (place,).
        points: Shape (place, point, 2).

    Returns:
        Values and slopes at 0, shape (place, 2) each.
    """
    weight = weights.sum(axis=1)
    middle = (weights * t).sum(axis=1) / weight
    t = t - middle[:, None]
    once = weights * t
    spread = (once * t).sum(axis=1)
    # Points in one place have no direction, and points in two places no curvature.
    spread = np.where(spread > RANK * weight, spread, np.inf)
    lean, level = (once * t * t).sum(axis=1) / spread, (once * t).sum(axis=1) / weight
    square = t * t - lean[:, None] * t - level[:, None]
    twice = weights * square
    bend = (twice * square).sum(axis=1)
    bend = np.where(is_curved & (bend > RANK * (once * t * t * t).sum(axis=1)), bend, np.inf)
    values, slopes = [], []
    for axis in (0, 1):
        own = points[..., axis]
        mean = (weights * own).sum(axis=1) / weight
        slope = (once * own).sum(axis=1) / spread
        curve = (twice * own).sum(axis=1) / bend
        values.append(mean - slope * middle + curve * (middle * middle + lean * middle - level))
        slopes.append(slope - curve * (2 * middle + lean))
    return np.stack(values, axis=1), np.stack(slopes, axis=1)
