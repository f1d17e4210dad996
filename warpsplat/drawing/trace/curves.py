"""As few lines and cubics as hold a polyline.

All candidates between two knots are fitted at once; dynamic programming finds the cheapest chain.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.beziers import distance_derivatives, points_at
from warpsplat.drawing.trace.ellipses import fit_ellipse
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.spans import Polyline, Span, cut_at_corners
from warpsplat.portable.elementary import hypot


@dataclass(frozen=True)
class Pieces:
    """Cubics in a row."""

    cubics: Floats
    """Control points, shape (piece, 4, 2); each begins where the one before ends."""
    lines: Bools
    """Which are straight, shape (piece,)."""


def fit_polylines(runs: list[Polyline], tolerance: float) -> list[Pieces]:
    """Return lines and cubics for each run.

    Args:
        runs: Parts of outlines.
        tolerance: Largest distance of a point from its curve [px].
    """
    known = [_polygon_or_ellipse(run, tolerance) for run in runs]
    spans = [
        [] if pieces else cut_at_corners(run, tolerance) for run, pieces in zip(runs, known, strict=True)
    ]
    fitted = _fitted(list(itertools.chain.from_iterable(spans)), tolerance)
    return [
        pieces or _with_level_lines(list(itertools.islice(fitted, len(own))), run.closed, tolerance)
        for run, pieces, own in zip(runs, known, spans, strict=True)
    ]


def straight(start: Floats, end: Floats) -> Floats:
    """Return lines between points (..., 2) as cubics, shape (..., 4, 2)."""
    return start[..., None, :] + (end - start)[..., None, :] * (np.arange(4)[:, None] / 3)


def _polygon_or_ellipse(run: Polyline, tolerance: float) -> Pieces | None:
    if run.is_polygon:
        cubics = straight(run.points[:-1], run.points[1:])
        return Pieces(cubics, np.ones(len(cubics), np.bool_))
    ellipse = fit_ellipse(run.points, tolerance) if run.closed else None
    return None if ellipse is None else Pieces(ellipse, np.zeros(4, np.bool_))


CHUNK = 20_000  # candidates that are fitted at once, about, which bounds the memory


def _fitted(spans: list[Span], tolerance: float) -> Iterator[Pieces]:
    """Yield the cheapest chain of each span."""
    pairs = [np.triu_indices(len(span.knots), 1) for span in spans]
    chunks = np.cumsum([len(first) for first, _ in pairs]) // CHUNK
    for _, group in itertools.groupby(range(len(spans)), lambda i: chunks[i]):
        own = [(spans[i], *pairs[i]) for i in group]
        start, end = (np.concatenate([span.knots[ij[k]] for span, *ij in own]) for k in (0, 1))
        ahead, back = (np.concatenate([span.tangents[ij[k]] for span, *ij in own]) for k in (0, 1))
        points = np.concatenate([_samples(*candidates) for candidates in own])
        # Towards a knot its own place counts, not the noisy point there.
        points[:, 0], points[:, -1] = start, end
        line_error = _line_errors(start, end, points)
        cubics, cubic_error = fit_cubics(start, ahead, -back, end, points)
        low = 0
        for _, first, last in own:
            part = slice(low, low + len(first))
            low = part.stop
            pair = np.stack([first, last], axis=1)
            yield _cheapest(pair, cubics[part], cubic_error[part], line_error[part], tolerance)


SAMPLES = 16  # points at which the error of a candidate is measured


def _samples(span: Span, first: Ints, last: Ints) -> Floats:
    """Return points of a span between pairs of knots, shape (pair, SAMPLES, 2)."""
    low, high = span.places[first], span.places[last]
    where = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, SAMPLES)[None]
    left = np.minimum(where.astype(np.intp), len(span.points) - 2)
    share = (where - left)[..., None]
    return span.points[left] * (1 - share) + span.points[left + 1] * share


def _line_errors(start: Floats, end: Floats, points: Floats) -> Floats:
    """Return the largest distance of points (line, sample, 2) from straight lines, shape (line,)."""
    chord = end - start
    size = np.maximum(hypot(*chord.T), 1e-9)
    away = points - start[:, None]
    aside = np.abs(away[..., 0] * chord[:, None, 1] - away[..., 1] * chord[:, None, 0]).max(axis=1) / size
    along = (away * chord[:, None]).sum(axis=2) / size[:, None]
    beyond = np.maximum(-along, along - size[:, None]).max(axis=1)
    return np.where(size < 1e-6, np.inf, np.maximum(aside, beyond))


LINE_COST, CUBIC_COST = 1.0, 1.4  # what a piece counts, about its bytes
ERROR_COST = 0.35  # what an error of the size of the tolerance counts for each piece


def _cheapest(
    pairs: Ints, cubics: Floats, cubic_error: Floats, line_error: Floats, tolerance: float
) -> Pieces:
    """Return the cheapest chain of candidates from the first knot to the last one.

    Args:
        pairs: First and last knot of each candidate, shape (pair, 2), ascending.
        cubics: Shape (pair, 4, 2).
        cubic_error: Of the cubics [px], shape (pair,).
        line_error: Of straight lines [px], shape (pair,).
        tolerance: Of the error [px].
    """

    def costs(error: Floats, base: float) -> Floats:
        return np.where(error <= tolerance, base + ERROR_COST * (error / tolerance) ** 2, np.inf)

    as_line, as_cubic = costs(line_error, LINE_COST), costs(cubic_error, CUBIC_COST)
    # The piece between two neighbouring knots is taken whatever its error.
    is_shortest = pairs[:, 1] - pairs[:, 0] == 1
    as_cubic = np.where(is_shortest & ~np.isfinite(as_cubic), 2 * CUBIC_COST, as_cubic)
    cost = np.minimum(as_line, as_cubic).tolist()
    count = int(pairs[-1, 1]) + 1
    best, back = [np.inf] * count, [-1] * count
    best[0] = 0.0
    for number, (i, j) in enumerate(pairs.tolist()):  # ascending in i, so that best[i] is final
        total = best[i] + cost[number]
        if total < best[j]:
            best[j], back[j] = total, number
    picked, knot = [], count - 1
    while knot > 0:
        picked.append(back[knot])
        knot = int(pairs[back[knot], 0])
    picked.reverse()
    lines, curves = as_line[picked] <= as_cubic[picked], cubics[picked]
    return Pieces(np.where(lines[:, None, None], straight(curves[:, 0], curves[:, 3]), curves), lines)


ROUNDS = 3  # of fitting handles and finding the parameters of the points


def fit_cubics(
    start: Floats, ahead: Floats, back: Floats, end: Floats, points: Floats
) -> tuple[Floats, Floats]:
    """Fit cubics of given ends and tangents to points (Schneider 1990).

    Args:
        start: Shape (cubic, 2).
        ahead: Unit tangents there, shape (cubic, 2).
        back: Unit tangents at the end, pointing back, shape (cubic, 2).
        end: Shape (cubic, 2).
        points: Shape (cubic, sample, 2).

    Returns:
        The cubics, shape (cubic, 4, 2), and their largest distances from the points, shape (cubic,).
    """
    steps = hypot(*np.moveaxis(np.diff(points, axis=1), 2, 0))
    t = np.concatenate([np.zeros((len(points), 1)), np.cumsum(steps, axis=1)], axis=1)
    t /= np.maximum(t[:, -1:], 1e-9)
    cubics = _with_handles(start, ahead, back, end, points, t)
    for _ in range(ROUNDS - 1):
        t = _nearer(cubics, points, t)
        cubics = _with_handles(start, ahead, back, end, points, t)
    off = hypot(*np.moveaxis(points_at(cubics, t) - points, 2, 0))
    return cubics, off.max(axis=1)


def _with_handles(
    start: Floats, ahead: Floats, back: Floats, end: Floats, points: Floats, t: Floats
) -> Floats:
    """Return cubics with handles of lengths found by least squares, a third of the chord where that fails."""
    s = 1 - t
    near_start, near_end = s * s * (1 + 2 * t), t * t * (3 - 2 * t)
    b1, b2 = 3 * s * s * t, 3 * s * t * t
    a11, a22 = (b1 * b1).sum(axis=1), (b2 * b2).sum(axis=1)
    a12 = (b1 * b2).sum(axis=1) * (ahead * back).sum(axis=1)
    y1, y2 = np.zeros(len(t)), np.zeros(len(t))
    for axis in (0, 1):
        rest = points[..., axis] - near_start * start[:, None, axis] - near_end * end[:, None, axis]
        y1 += (b1 * rest).sum(axis=1) * ahead[:, axis]
        y2 += (b2 * rest).sum(axis=1) * back[:, axis]
    det = a11 * a22 - a12**2
    safe = np.where(np.abs(det) > 1e-9, det, 1)
    first, second = (a22 * y1 - a12 * y2) / safe, (a11 * y2 - a12 * y1) / safe
    chord = hypot(*(end - start).T)
    bad = (np.abs(det) <= 1e-9) | (first < 0.02 * chord) | (second < 0.02 * chord)
    bad |= (first > 3 * chord) | (second > 3 * chord)
    first, second = np.where(bad, chord / 3, first), np.where(bad, chord / 3, second)
    return np.stack([start, start + first[:, None] * ahead, end + second[:, None] * back, end], axis=1)


def _nearer(cubics: Floats, points: Floats, t: Floats) -> Floats:
    """Return parameters nearer to points, by a step of Newton's method."""
    first, second = distance_derivatives(cubics, points, t)
    step = first / np.where(np.abs(second) > 1e-9, second, 1)
    moved = np.clip(t - np.clip(step, -0.1, 0.1), 0, 1)
    moved[:, 0], moved[:, -1] = 0, 1
    return np.maximum.accumulate(moved, axis=1)


LEVEL_SLOPE = 0.012  # up to which a line is made horizontal or vertical
LEVEL_OFF = 1.2  # of its ends from that, over the tolerance, at the most
LEAST_LEVEL = 1.5  # [px] length of such a line


def _with_level_lines(spans: list[Pieces], closed: bool, tolerance: float) -> Pieces:
    """Return the pieces of a run's spans, with lines made horizontal or vertical where they nearly are."""
    cubics = np.concatenate([pieces.cubics for pieces in spans])
    lines = np.concatenate([pieces.lines for pieces in spans])
    count = len(cubics)
    for k in np.flatnonzero(lines).tolist():
        chord = cubics[k, 3] - cubics[k, 0]
        for axis in (0, 1):
            limit = min(LEVEL_OFF * tolerance, LEVEL_SLOPE * abs(chord[1 - axis]) + 0.02)
            if 0 < abs(chord[axis]) <= limit and abs(chord[1 - axis]) > LEAST_LEVEL:
                value = 0.5 * (cubics[k, 0, axis] + cubics[k, 3, axis])
                if closed or k > 0:
                    _move_end(cubics[(k - 1) % count, ::-1, axis], value)
                if closed or k + 1 < count:
                    _move_end(cubics[(k + 1) % count, :, axis], value)
                cubics[k, :, axis] = value
    cubics[lines] = straight(cubics[lines, 0], cubics[lines, 3])
    return Pieces(cubics, lines)


def _move_end(coordinates: Floats, value: float) -> None:
    """Move the first of a cubic's four coordinates to ``value``, with its handle, in place."""
    coordinates[1] += value - coordinates[0]
    coordinates[0] = value
