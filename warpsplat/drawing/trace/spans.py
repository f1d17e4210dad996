"""Parts of outlines, cut at their corners, with the places where curves may begin and end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.drawing.trace.corners import BENT, find_corners
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.polylines import Polylines
from warpsplat.portable.elementary import hypot
from warpsplat.scene.scene import ranges, starts_of

FINE_TOLERANCE = 0.3  # [px] up to which corners are looked for at their finest scale
SPACING = 1.5  # [px] between knots, about
FINE = 6  # points of a span from one knot to the next
WINDOW = 12.0  # tolerances of outline on each side of a knot that tell its place and tangent
AROUND = np.linspace(-1, 1, 9)  # places within this window whose points are looked at


@dataclass(frozen=True)
class Polyline:
    """A part of an outline, to be fitted."""

    points: Floats
    """Shape (point, 2)."""
    closed: bool
    start: Floats | None = None
    """Where an open one begins, shape (2,)."""
    end: Floats | None = None

    def scaled(self, factor: float) -> Polyline:
        """Return the outline at another size."""
        start, end = (None if each is None else each * factor for each in (self.start, self.end))
        return replace(self, points=self.points * factor, start=start, end=end)

    def whole(self) -> Floats:
        """Return all points: of an open one with its ends, of a closed one from where it is upright."""
        if self.closed:
            return np.roll(self.points, -int(self.points[:, 0].argmin()), axis=0)
        assert self.start is not None and self.end is not None
        return np.concatenate([self.start[None], self.points, self.end[None]])


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
    """Return the spans of runs, in order along each.

    Args:
        runs: Parts of outlines.
        tolerances: Of the curves that are to be fitted to each [px]; for coarser ones corners are broader.
        doubt: As for ``find_corners``.
    """
    lines = Polylines([run.whole() for run in runs], [run.closed for run in runs])
    corners = find_corners(lines, np.maximum(1, np.asarray(tolerances) / FINE_TOLERANCE), doubt)
    is_cut = np.bincount(corners.owner, minlength=len(runs)) > 0
    # A closed one begins at its first corner, if it has one, and ends there again.
    again = np.searchsorted(corners.owner, np.flatnonzero(lines.closed & is_cut))
    whole = np.flatnonzero(~(lines.closed & is_cut))
    owner = np.concatenate([whole, corners.owner, whole, corners.owner[again]])
    beyond = corners.along[again] + lines.totals[corners.owner[again]]
    begin, end = np.zeros(len(whole)), lines.totals[whole]
    along = np.concatenate([begin, corners.along, end, beyond])
    ends = lines.at(whole, begin), corners.points, lines.at(whole, end), corners.points[again]
    order = np.lexsort((along, owner))
    bent = np.repeat([0, BENT, 0, BENT], [len(each) for each in ends])[order]
    owner, along, stops = owner[order], along[order], np.concatenate(ends)[order]
    cut = np.flatnonzero(owner[1:] == owner[:-1])
    is_ring = (lines.closed & ~is_cut)[owner[cut]]
    curves = np.maximum(np.diff(along)[cut] / SPACING, 1).astype(np.intp)
    span = np.repeat(np.arange(len(cut)), FINE * curves + 1)
    number = ranges(np.zeros_like(curves), FINE * curves + 1)
    low, high = along[cut][span], along[cut + 1][span]
    where = low + (high - low) * (number / (FINE * curves)[span])
    # To its corners, beside which antialiasing bends it, an outline goes straight.
    before, after = (np.minimum(bent[stop][span], (high - low) / 2) for stop in (cut, cut + 1))
    points = lines.at(owner[cut][span], np.clip(where, low + before, high - after))
    for stop, length, away in ((cut, before, where - low), (cut + 1, after, high - where)):
        share = np.maximum(1 - away / np.maximum(length, 1e-9), 0)[:, None]
        points += share * (stops[stop][span] - points)
    knots = number % FINE == 0
    places, first = np.flatnonzero(knots), starts_of(curves + 1)
    span, number = span[knots], number[knots]
    steps = FINE * curves[span]
    reach = WINDOW * np.asarray(tolerances)[owner[cut][span]] * steps / np.maximum((high - low)[knots], 1e-9)
    fitted, tangents = _smoothed(points, places - number, steps, number, is_ring[span], reach)
    sharp = (number % steps == 0) & ~is_ring[span]
    fitted[sharp] = points[places[sharp]]
    return Spans(owner[cut], points, first, fitted, tangents, places)


def _smoothed(
    points: Floats, first: Ints, steps: Ints, places: Ints, is_ring: Bools, reach: Floats
) -> tuple[Floats, Floats]:
    """Return where spans pass at some places, and their directions, by parabolas through what is beside.

    Args:
        points: Of all spans.
        first: The first point of the span of each place, shape (place,), as all that follow.
        steps: Steps from point to point of the span.
        places: How many steps after its first point each place is.
        is_ring: Whether the span goes on where it ends.
        reach: Steps on each side that tell.
    """
    reach = np.minimum(reach, steps / 2)
    middle = np.where(is_ring, places, np.clip(places, reach, steps - reach))
    where = middle[:, None] + reach[:, None] * AROUND
    where = np.where(is_ring[:, None], where % steps[:, None], where)
    beside = between(points, first[:, None], where, steps[:, None])
    square = AROUND * AROUND
    level = square.mean()
    away = ((places - middle) / reach)[:, None]
    slope = (beside * AROUND[:, None]).sum(axis=1) / square.sum()
    bend = (beside * (square - level)[:, None]).sum(axis=1) / ((square - level) * (square - level)).sum()
    tangents = slope + 2 * away * bend
    size = np.maximum(hypot(*tangents.T), 1e-9)[:, None]
    return beside.mean(axis=1) + away * slope + (away * away - level) * bend, tangents / size


def between(points: Floats, first: Ints, where: Floats, steps: Ints) -> Floats:
    """Return points ``where`` steps after the ``first`` ones of spans with so many ``steps``."""
    low = np.minimum(where.astype(np.intp), steps - 1)
    start = points[first + low]
    return start + (where - low)[..., None] * (points[first + low + 1] - start)
