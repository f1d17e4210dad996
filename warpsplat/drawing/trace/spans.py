"""Parts of outlines, cut at their corners, with the places where curves may begin and end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.drawing.trace.corners import Corners, find_corners
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.polylines import Polylines
from warpsplat.portable.elementary import hypot
from warpsplat.scene.scene import ranges, starts_of

FINE_TOLERANCE = 0.3  # [px] up to which corners are looked for at their finest scale
SPACING = 1.5  # [px] between knots, about
WINDOW = 12.0  # tolerances of outline on each side of a knot that tell its place and tangent
END_WEIGHT = 16.0  # of a corner or junction, which is known exactly
RANK = 1e-24  # what is left of a sum of squares, over the whole, that counts as 0
CHUNK = 8192  # knots that are smoothed at once, which bounds the memory


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

    def scaled(self, factor: float) -> Polyline:
        """Return the outline at another size."""
        start, end = (None if each is None else each * factor for each in (self.start, self.end))
        return replace(self, points=self.points * factor, start=start, end=end)

    def with_ends(self) -> Floats:
        """Return the points and, of an open one, its ends; none of them twice in a row."""
        if self.closed:
            return self.points
        assert self.start is not None and self.end is not None
        points = np.concatenate([self.start[None], self.points, self.end[None]])
        keep = np.concatenate([[True], hypot(*np.diff(points, axis=0).T) > 1e-6])
        return np.asarray(points[keep] if keep.sum() > 1 else points[:2])


@dataclass(frozen=True)
class Spans:
    """Parts of runs between two corners, or smooth rings, one after the other."""

    owner: Ints
    """The run that each is a part of, shape (span,)."""
    points: Floats
    """Points of all spans, shape (point, 2)."""
    first: Ints
    """First knot of each and, last, the number of knots, shape (span + 1,)."""
    knots: Floats
    """Where one curve may end and the next begin, shape (knot, 2)."""
    tangents: Floats
    """Unit vectors there, shape (knot, 2)."""
    places: Ints
    """Number of the point at each knot, shape (knot,)."""

    def at(self, index: Ints, first: Ints) -> Spans:
        """Return spans of the knots ``index``, each of them part of one here; ``first``: as here."""
        owner = self.owner[np.searchsorted(self.first, index[first[:-1]], "right") - 1]
        return Spans(owner, self.points, first, self.knots[index], self.tangents[index], self.places[index])


def cut_at_corners(
    runs: Sequence[Polyline], tolerances: Sequence[float], doubt: Floats | None = None
) -> Spans:
    """Return the spans of runs, in order along each; smooth rings come last.

    Args:
        runs: No polygons.
        tolerances: Of the curves that are to be fitted to each [px]; for coarser ones corners are broader.
        doubt: As for ``find_corners``.
    """
    lines = Polylines.joined([run.with_ends() for run in runs], [run.closed for run in runs])
    corners = find_corners(lines, np.maximum(1, np.asarray(tolerances) / FINE_TOLERANCE), doubt)
    owner, parts = _cut(lines, corners)
    smooth = np.flatnonzero(lines.closed & (np.bincount(corners.owner, minlength=len(lines)) == 0))
    points = [runs[ring].points for ring in smooth.tolist()]
    # Begun where they go straight up or down.
    begun = [np.roll(ring, -int(ring[:, 0].argmin()), axis=0) for ring in points]
    rings = Polylines.joined(begun, [True] * len(begun))
    owner = np.concatenate([owner, smooth])
    return _with_knots(owner, parts.and_also(rings), WINDOW * np.asarray(tolerances)[owner])


def _cut(lines: Polylines, corners: Corners) -> tuple[Ints, Polylines]:
    """Return the parts of polylines between corners, and the polyline that each is of."""
    has_corner = np.bincount(corners.owner, minlength=len(lines)) > 0
    opened, closed = np.flatnonzero(~lines.closed), np.flatnonzero(lines.closed & has_corner)
    begin, end = lines.first[opened], lines.first[opened + 1] - 1
    # A closed one begins at its first corner and ends there again.
    again = np.searchsorted(corners.owner, closed)
    owner = np.concatenate([opened, corners.owner, opened, closed])
    beyond = corners.along[again] + lines.totals[closed]
    along = np.concatenate([lines.along[begin], corners.along, lines.along[end], beyond])
    stops = np.concatenate([lines.points[begin], corners.points, lines.points[end], corners.points[again]])
    at_end = np.full(len(opened), 1e-6)
    bent = np.concatenate([at_end, corners.bent, at_end, corners.bent[again]])
    order = np.lexsort((along, owner))
    owner, along, stops, bent = owner[order], along[order], stops[order], bent[order]
    cut = np.flatnonzero(owner[1:] == owner[:-1])
    inner, counts = _between(lines, owner[cut], (along + bent)[cut], (along - bent)[cut + 1])
    first = starts_of(counts + 2)
    points = np.empty((first[-1], 2))
    points[first[:-1]], points[first[1:] - 1] = stops[cut], stops[cut + 1]
    points[ranges(first[:-1] + 1, counts)] = lines.points[inner]
    return owner[cut], Polylines.of(points, first, np.zeros(len(cut), np.bool_))


def _between(lines: Polylines, which: Ints, low: Floats, high: Floats) -> tuple[Ints, Ints]:
    """Return the numbers of the points between pairs of arc lengths, and how many points each pair has.

    Closed polylines go on after their length.
    """
    count, total = lines.counts[which], lines.totals[which]

    def until(where: Floats) -> Ints:
        turns = np.where(lines.closed[which], np.floor(where / np.maximum(total, 1e-9)), 0)
        rest = np.clip(where - turns * total, 0, total)
        return turns.astype(np.intp) * count + np.minimum(lines.points_until(which, rest), count)

    begin = until(low)
    counts = np.maximum(until(np.nextafter(high, -np.inf)) - begin, 0)
    owner = np.repeat(np.arange(len(which)), counts)
    return lines.first[which][owner] + ranges(begin, counts) % count[owner], counts


def _with_knots(owner: Ints, parts: Polylines, windows: Floats) -> Spans:
    """Return spans of the points of ``parts``, of runs ``owner``.

    ``windows``: lengths of outline beside knots that tell where they are, shape (part,).
    """
    counts = np.maximum(parts.totals / SPACING, 1).astype(np.intp)
    span, number = np.repeat(np.arange(len(parts)), counts + 1), ranges(np.zeros_like(counts), counts + 1)
    first, last = parts.first[:-1][span], parts.first[1:][span] - 1
    wanted = number * (parts.totals / counts)[span]
    right = first + np.clip(parts.points_until(span, wanted), 1, last - first)
    places = right - (wanted - parts.along[right - 1] < parts.along[right] - wanted)
    places = np.where(number == 0, first, np.where(number == counts[span], last, places))
    is_new = np.append(True, np.diff(places) != 0)[: len(places)]
    span, places = span[is_new], places[is_new]
    around = _three_times_around(parts)
    chunks = [slice(low, low + CHUNK) for low in range(0, max(len(span), 1), CHUNK)]
    smoothed = [_smoothed(parts, around, span[i], places[i], windows[span[i]]) for i in chunks]
    knots, tangents = (np.concatenate(part) for part in zip(*smoothed, strict=True))
    starts = np.searchsorted(span, np.arange(len(parts) + 1))
    begin, end = starts[:-1], starts[1:] - 1
    knots[begin] = np.where(parts.closed[:, None], knots[begin], parts.points[places[begin]])
    knots[end] = np.where(parts.closed[:, None], knots[begin], parts.points[places[end]])
    tangents[end] = np.where(parts.closed[:, None], tangents[begin], tangents[end])
    return Spans(owner, parts.points, starts, knots, tangents, places)


def _three_times_around(lines: Polylines) -> Polylines:
    """Return polylines in which closed ones go around three times."""
    times = np.where(lines.closed, 3, 1)
    counts = times * lines.counts
    owner, number = np.repeat(np.arange(len(lines)), counts), ranges(np.zeros_like(counts), counts)
    index = lines.first[owner] + number % lines.counts[owner]
    along = lines.along[index] + number // lines.counts[owner] * lines.totals[owner]
    return Polylines(lines.points[index], starts_of(counts), np.zeros(len(lines), np.bool_), along)


def _smoothed(
    lines: Polylines, around: Polylines, which: Ints, places: Ints, window: Floats
) -> tuple[Floats, Floats]:
    """Return where outlines pass at some points, and their directions, by parabolas through those nearby.

    Args:
        lines: The outlines.
        around: The same three times around.
        which: Numbers of outlines, shape (place,).
        places: Numbers of points of ``lines``, shape (place,).
        window: Lengths of outline on each side that tell, shape (place,).
    """
    total, closed, count = lines.totals[which], lines.closed[which], lines.counts[which]
    first, last = around.first[which], around.first[which + 1] - 1
    turn, here = closed * count, lines.along[places] + closed * total
    window = np.where(closed, np.minimum(window, 0.5 * total), window)
    middle = first + turn + places - lines.first[which]
    # The third of the nearest points is within reach.
    beside = np.clip(middle - 2, first, np.maximum(last - 4, first)) + np.arange(5)[:, None]
    away = np.abs(around.along[np.minimum(beside, last)] - here)
    away = np.sort(np.where(beside <= last, away, np.inf), axis=0)
    third = away[np.minimum(2, last - first), np.arange(len(which))]
    reach = np.maximum(window, third + 1e-9)  # so that rounding does not leave it out
    low = around.points_until(which, np.nextafter(here - reach, -np.inf))
    counts = np.minimum(around.points_until(which, here + reach) - low, count)
    # The points near all places as one array, filled up with points that have no weight.
    number = np.arange(counts.max(initial=1))[:, None]
    columns = np.minimum(first + low + number, last)
    along = around.along[columns]
    is_end = ~closed & ((along == 0) | (along == total))
    weights = np.where(is_end, END_WEIGHT, 1.0) * (number < counts)
    is_curved = (counts > 4) & (around.along[first + low + counts - 1] - along[0] > 2)
    knots, slopes = _parabolas(along - here, weights, is_curved, around.points[columns])
    size = hypot(*slopes.T)
    still = size < 1e-9
    chords = around.points[np.minimum(middle + 1, last)] - around.points[np.maximum(middle - 1, first)]
    slopes[still] = chords[still]
    size = np.where(still, hypot(*slopes.T), size)
    return knots, slopes / np.maximum(size, 1e-9)[:, None]


def _parabolas(t: Floats, weights: Floats, is_curved: Bools, points: Floats) -> tuple[Floats, Floats]:
    """Fit parabolas, or lines where not ``is_curved``, by least squares with orthogonal polynomials of ``t``.

    Args:
        t: Of the points, shape (point, place).
        weights: Of the squared errors, shape (point, place).
        is_curved: Shape (place,).
        points: Shape (point, place, 2).

    Returns:
        Values and slopes at 0, shape (place, 2) each.
    """
    weight = weights.sum(axis=0)
    middle = (weights * t).sum(axis=0) / weight
    t = t - middle
    once = weights * t
    spread = (once * t).sum(axis=0)
    # Points in one place have no direction, and points in two places no curvature.
    spread = np.where(spread > RANK * weight, spread, np.inf)
    lean, level = (once * t * t).sum(axis=0) / spread, (once * t).sum(axis=0) / weight
    square = t * t - lean * t - level
    twice = weights * square
    bend = (twice * square).sum(axis=0)
    bend = np.where(is_curved & (bend > RANK * (once * t * t * t).sum(axis=0)), bend, np.inf)
    values, slopes = [], []
    for axis in (0, 1):
        own = points[..., axis]
        mean = (weights * own).sum(axis=0) / weight
        slope = (once * own).sum(axis=0) / spread
        curve = (twice * own).sum(axis=0) / bend
        values.append(mean - slope * middle + curve * (middle * middle + lean * middle - level))
        slopes.append(slope - curve * (2 * middle + lean))
    return np.stack(values, axis=1), np.stack(slopes, axis=1)
