"""The cheapest chain of lines and cubics along a span, from knot to knot."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from warpsplat.drawing.trace.cubics import fit_handles
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.spans import Spans, between
from warpsplat.portable.elementary import hypot
from warpsplat.scene.scene import ranges, starts_of

SAMPLES = 16  # points at which the error of a candidate is measured at first
DENSE = 6  # most points of a span from one of these to the next: a bulge between them could be missed
BULGE = 2.0  # error of a bulge between them, over the tolerance, from which on a candidate is refused
CUBIC_COST = 1.4  # what a cubic counts, where a line and an error of the size of the tolerance count 1
MOST_KNOTS = 48  # between which all curves are tried
CHUNK = 2048  # candidates that are fitted at once: their arrays fit a processor's cache


@dataclass(frozen=True)
class CurvePieces:
    """CurvePieces that may be parts of chains."""

    span: Ints
    """The span that each is in, shape (candidate,)."""
    begin: Ints
    """The number of the knot where it begins, shape (candidate,); as well ``end``."""
    end: Ints
    cubics: Floats
    """Shape (candidate, 4, 2)."""
    is_line: Bools
    """Whether a straight line is cheaper, shape (candidate,)."""
    costs: Floats
    """Infinite where neither is near enough, shape (candidate,)."""

    def take(self, index: Ints | Bools) -> CurvePieces:
        """Return some of them."""
        return CurvePieces(*(getattr(self, field.name)[index] for field in fields(CurvePieces)))

    @staticmethod
    def joined(parts: list[CurvePieces]) -> CurvePieces:
        """Return those of several groups."""
        return CurvePieces(
            *(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(CurvePieces))
        )


def cheapest_chains(spans: Spans, tolerances: Floats, most: int = 1) -> CurvePieces:
    """Return the pieces of the cheapest chain of each span, in order.

    Of a long span a few knots are tried first; where no curve from one to the next is near enough, those
    between them, too. Many spans need no other than their ends.

    Args:
        spans: Not empty.
        tolerances: Largest distance of a point of each from its curve [px], shape (span,).
        most: Pieces that a span is divided into at first, at the most.
    """
    steps = np.diff(spans.first) - 1
    counts = np.minimum(steps, most) + 1
    owner, number = np.repeat(np.arange(len(steps)), counts), ranges(np.zeros_like(counts), counts)
    first = starts_of(counts)
    index = spans.first[owner] + number * steps[owner] // (counts[owner] - 1)
    chains = _cheapest(spans.at(index, first), tolerances)
    chains = replace(chains, begin=index[chains.begin], end=index[chains.end])
    far = ~np.isfinite(chains.costs) & (chains.end > chains.begin + 1)
    if far.any():
        begin, counts, span = chains.begin[far], (chains.end - chains.begin)[far] + 1, chains.span[far]
        inner = ranges(begin, counts)
        parts = cheapest_chains(spans.at(inner, starts_of(counts)), tolerances[span], MOST_KNOTS)
        parts = replace(parts, span=span[parts.span], begin=inner[parts.begin], end=inner[parts.end])
        chains = CurvePieces.joined([chains.take(~far), parts])
    return chains.take(np.argsort(chains.begin, kind="stable"))


def _cheapest(spans: Spans, tolerances: Floats) -> CurvePieces:
    """Return the cheapest chains of spans with few knots, by dynamic programming over pairs of knots."""
    first, last = spans.first[:-1], spans.first[1:] - 1
    number, level, end = _pairs(last - first + 1)
    begin, end = first[number] + level, first[number] + end
    pieces = _candidates(spans, number, begin, end, tolerances)
    # A curve may go to the next knot, whatever its error, if no chain can do without.
    costs = np.where((end == begin + 1) & ~np.isfinite(pieces.costs), MOST_KNOTS, pieces.costs)
    best, back = np.full(len(spans.knots), np.inf), np.zeros(len(spans.knots), np.intp)
    best[first] = 0
    order = np.argsort(level, kind="stable")
    # What begins at the nth knot of a span comes after what ends there, so that its cost is known.
    for part in np.split(order, np.flatnonzero(np.diff(level[order])) + 1):
        total, goal = best[begin[part]] + costs[part], end[part]
        better = total < best[goal]
        best[goal[better]], back[goal[better]] = total[better], part[better]
    at, picked = last, [back[:0]]
    while len(at):
        picked.append(back[at])
        at = begin[picked[-1]][level[picked[-1]] > 0]
    return pieces.take(np.concatenate(picked))


def _pairs(counts: Ints) -> tuple[Ints, Ints, Ints]:
    """Return all pairs of ascending numbers below each count: the index of the count, and the two numbers."""
    owner, low = np.repeat(np.arange(len(counts)), counts), ranges(np.zeros_like(counts), counts)
    after = counts[owner] - 1 - low
    return np.repeat(owner, after), np.repeat(low, after), ranges(low + 1, after)


def _candidates(spans: Spans, span: Ints, begin: Ints, end: Ints, tolerances: Floats) -> CurvePieces:
    """Return candidates between knots, shape (candidate,) each."""
    parts = [slice(low, low + CHUNK) for low in range(0, max(len(span), 1), CHUNK)]
    return CurvePieces.joined([_some(spans, span[i], begin[i], end[i], tolerances) for i in parts])


def _some(
    spans: Spans, span: Ints, begin: Ints, end: Ints, tolerances: Floats, samples: int = SAMPLES
) -> CurvePieces:
    """Return candidates as ``_candidates``, not so many."""
    low, steps = spans.places[begin], spans.places[end] - spans.places[begin]
    start, goal = spans.knots[begin], spans.knots[end]
    where = steps * np.linspace(0, 1, samples)[:, None]
    x, y = np.moveaxis(between(spans.points, low, where, steps) - start, 2, 0)
    # Towards a knot its own place counts, not the noisy point there.
    x[0], y[0], (x[-1], y[-1]) = 0, 0, (goal - start).T
    tolerance = tolerances[span]
    costs = _costs(_line_errors(x, y), 1, tolerance)
    is_line = np.isfinite(costs)
    cubics = np.stack([start, start, goal, goal], axis=1)
    # No cubic is cheaper than a line that is near enough.
    bent = np.flatnonzero(~is_line)
    ahead, back = spans.tangents[begin[bent]], -spans.tangents[end[bent]]
    handles, errors = fit_handles(ahead.T, back.T, x[:, bent], y[:, bent])
    cubics[bent, 1] += handles[0][:, None] * ahead
    cubics[bent, 2] += handles[1][:, None] * back
    costs[bent] = _costs(errors, CUBIC_COST, tolerance[bent])
    some = np.flatnonzero(np.isfinite(costs) & (steps > DENSE * samples))
    if len(some):
        finer = _some(spans, span[some], begin[some], end[some], BULGE * tolerances, 4 * samples)
        costs[some[np.isinf(finer.costs)]] = np.inf
    return CurvePieces(span, begin, end, cubics, is_line, costs)


def _costs(errors: Floats, base: float, tolerance: Floats) -> Floats:
    return np.where(errors <= tolerance, base + (errors / tolerance) ** 2, np.inf)


def _line_errors(x: Floats, y: Floats) -> Floats:
    """Return the largest distance of points (sample, line) from the line between the origin and the last."""
    end_x, end_y = x[-1], y[-1]
    size = np.maximum(hypot(end_x, end_y), 1e-9)
    aside = np.abs(x * end_y - y * end_x).max(axis=0) / size
    along = (x * end_x + y * end_y) / size
    beyond = np.maximum(-along, along - size).max(axis=0)
    return np.where(size < 1e-6, np.inf, np.maximum(aside, beyond))
