"""As few lines and cubics as hold a polyline: all candidates are fitted at once, the best chain is found by
dynamic programming.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.corners import find_corners, lengths
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import eigh, lstsq, product, solve

SAMPLES = 16
"""Points that a candidate is measured at."""

KNOTS = 48
"""The most places of a span where one curve may end and the next begin."""

SPACING = 1.5
"""Least distance of two of these [px]."""

WINDOW = 4.0
"""Length on each side of a point that tells its place and tangent [px]."""

LINE_COST, CUBIC_COST = 1.0, 1.4
"""What a piece counts, about its bytes."""

ERROR_COST = 0.35
"""What an error of the size of the tolerance counts for each piece."""

TURNS = 3
"""Times that the parameters of points are found anew."""

FLAT_SLOPE = 0.012
"""Slope below which a line is taken as horizontal or vertical, if its ends differ by about a tolerance."""

RANK = 1e-24
"""What is left of a sum of squares, over the whole, that is none."""

CIRCLE = 4 * (np.sqrt(2) - 1) / 3
"""Length of the handles of a quarter of the unit circle."""

CHUNK = 20000


@dataclass(frozen=True)
class Run:
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
class Pieces:
    """Cubics in a row."""

    cubics: Floats
    """Control points, shape (piece, 4, 2); each begins where the one before ends."""
    lines: Bools
    """Which are straight, shape (piece,)."""


@dataclass
class _Span:
    """Between two corners."""

    points: Floats
    knots: Floats
    """Candidates of ends, shape (knot, 2)."""
    tangents: Floats
    """There, unit vectors, shape (knot, 2)."""
    places: Ints
    """Of the knots in ``points``."""


def fit_runs(runs: list[Run], tolerance: float) -> list[Pieces]:
    """Lines and cubics for each run.

    Args:
        runs: parts of outlines.
        tolerance: largest distance of a point from its curve [px].
    """
    results: list[Pieces | None] = [None] * len(runs)
    spans: list[_Span] = []
    owners: list[int] = []
    for number, run in enumerate(runs):
        if run.is_polygon:
            results[number] = _polygon(run)
            continue
        ellipse = fit_ellipse(run.points, tolerance) if run.closed else None
        if ellipse is not None:
            results[number] = ellipse
            continue
        for span in _spans(run, tolerance):
            spans.append(span)
            owners.append(number)
    chosen = _choose(spans, tolerance)
    for number, group in itertools.groupby(range(len(spans)), lambda i: owners[i]):
        parts = [chosen[i] for i in group]
        pieces = Pieces(
            np.concatenate([part.cubics for part in parts]), np.concatenate([part.lines for part in parts])
        )
        results[number] = _tidied(pieces, runs[number].closed, tolerance)
    return [result for result in results if result is not None]


def straight(start: Floats, end: Floats) -> Floats:
    """A line as a cubic, shape (4, 2)."""
    return start + (end - start) * (np.arange(4)[:, None] / 3)


def _polygon(run: Run) -> Pieces:
    points = np.concatenate([run.points, run.points[:1]]) if run.closed else run.points
    cubics = np.stack([straight(a, b) for a, b in itertools.pairwise(points)])
    return Pieces(cubics, np.ones(len(cubics), np.bool_))


def fit_ellipse(points: Floats, tolerance: float) -> Pieces | None:
    """Four cubics, where a closed outline is a circle or an ellipse; else None."""
    if len(points) < 6:
        return None
    middle = points.mean(axis=0)
    away = points - middle
    x, y = away.T
    # A conic through the points: A x^2 + B xy + C y^2 + D x + E y = 1.
    matrix = np.stack([x * x, x * y, y * y, x, y], axis=1)
    conic = lstsq(matrix, np.ones(len(points)))
    shape = np.array([[conic[0], conic[1] / 2], [conic[1] / 2, conic[2]]])
    values, vectors = eigh(shape)
    if values.min() <= 1e-9:
        return None
    center = -0.5 * solve(shape, conic[3:])
    level = 1 + (product(shape, center) * center).sum()
    radii = np.sqrt(level / values)
    if radii.max() > 20 * radii.min():
        return None
    mean = float(np.sqrt(radii.prod()))
    limit = min(tolerance * (1 + 0.003 * mean), 0.12 * mean + 0.05)
    unit = product(away - center, vectors) / radii
    off = np.abs(hypot(*unit.T) - 1) * radii.min()
    if off.max() > 1.5 * limit or np.sqrt((off**2).mean()) > 0.6 * limit:
        return None
    if abs(radii[0] - radii[1]) < max(0.5 * tolerance, 0.004 * mean):
        vectors, radii = np.eye(2), np.full(2, radii.mean())
    elif shape[0, 0] > shape[1, 1]:  # so that it begins at the upper or left end of its longer axis
        vectors = -vectors
    frame = vectors * radii
    if frame[0, 0] * frame[1, 1] < frame[0, 1] * frame[1, 0]:
        frame[:, 1] *= -1
    if _signed(points) < 0:
        frame[:, 1] *= -1
    quarter = np.array([(1, 0), (1, CIRCLE), (CIRCLE, 1), (0, 1)])
    turn = np.array([(0, -1), (1, 0)])
    cubics = []
    for _ in range(4):
        cubics.append(product(quarter, frame.T) + middle + center)
        quarter = product(quarter, turn.T)
    return Pieces(np.stack(cubics), np.zeros(4, np.bool_))


def _signed(points: Floats) -> float:
    following = np.roll(points, -1, axis=0)
    return float((points[:, 0] * following[:, 1] - following[:, 0] * points[:, 1]).sum() / 2)


def _spans(run: Run, tolerance: float) -> list[_Span]:
    """The run, cut at its corners."""
    points = run.points
    if not run.closed:
        assert run.start is not None and run.end is not None
        points = np.concatenate([run.start[None], points, run.end[None]])
        keep = np.concatenate([[True], hypot(*np.diff(points, axis=0).T) > 1e-6])
        points = points[keep] if keep.sum() > 1 else points[:2]
    along = lengths(points, run.closed)
    corners = find_corners(points, run.closed, max(1.0, tolerance / 0.3)) if len(points) > 4 else []
    if run.closed and not corners:
        return [_closed_span(points, along)]
    if run.closed:
        stops = [*corners, (corners[0][0] + float(along[-1]), corners[0][1])]
    else:
        stops = [(0.0, points[0]), *corners, (float(along[-1]), points[-1])]
    spans = []
    for (low, first), (high, last) in itertools.pairwise(stops):
        spans.append(_span(points, along, run.closed, low, high, first, last))
    return spans


def _span(
    points: Floats, along: Floats, closed: bool, low: float, high: float, first: Floats, last: Floats
) -> _Span:
    """Its points, without those that the corners bend."""
    ring = np.concatenate([along[: len(points)], along[: len(points)] + along[-1]]) if closed else along
    many = np.concatenate([points, points]) if closed else points
    at_end = 0.0 if closed else 1e-6
    inside = (ring > low + (1.0 if closed or low > 0 else at_end)) & (
        ring < high - (1.0 if closed or high < along[-1] else at_end)
    )
    part = np.concatenate([first[None], many[inside], last[None]])
    return _with_knots(part)


def _closed_span(points: Floats, along: Floats) -> _Span:
    """A smooth ring, begun where it goes straight up or down."""
    start = int(points[:, 0].argmin())
    ring = np.roll(points, -start, axis=0)
    ring = np.concatenate([ring, ring[:1]])
    span = _with_knots(ring, closed=True)
    return span


def _with_knots(part: Floats, closed: bool = False) -> _Span:
    along = lengths(part, False)
    total = float(along[-1])
    count = int(np.clip(total / SPACING, 1, KNOTS))
    wanted = np.linspace(0, total, count + 1)
    places = np.unique(_nearest(along, wanted))
    if len(places) < 2:
        places = np.array([0, len(part) - 1])
    ring = part[:-1] if closed else part
    knots, tangents = _local(ring, along, places, closed)
    if not closed:
        knots[0], knots[-1] = part[0], part[-1]
    else:
        knots[-1], tangents[-1] = knots[0], tangents[0]
    return _Span(part, knots, tangents, places)


def _nearest(along: Floats, wanted: Floats) -> Ints:
    right = np.clip(np.searchsorted(along, wanted), 1, len(along) - 1)
    return right - (wanted - along[right - 1] < along[right] - wanted)


def _local(ring: Floats, along: Floats, places: Ints, closed: bool) -> tuple[Floats, Floats]:
    """Where the outline passes at ``places``, and its directions, by parabolas through the points near."""
    total, here, count = float(along[-1]), along[places], len(ring)
    along = along[:count]  # a closed outline's last point is its first one
    window, first = WINDOW, 0
    # Corners and junctions at the ends are known exactly.
    weights = np.where((along == 0) | (along == total), 16.0, 1.0)
    if closed:
        window, first, weights = min(WINDOW, 0.5 * total), count, np.ones(count)
        along = np.concatenate([along - total, along, along + total])
    beside = np.arange(min(5, len(along))) + np.clip(places[:, None] + first - 2, 0, max(len(along) - 5, 0))
    third = np.sort(np.abs(along[beside] - here[:, None]), axis=1)[:, min(2, len(along) - 1)]
    reach = np.maximum(window, third + 1e-9)  # so that rounding does not leave the third out
    low, high = np.searchsorted(along, here - reach), np.searchsorted(along, here + reach, side="right")
    counts = np.minimum(high - low, count)
    # The near points of all places as one array, filled up with points that have no weight.
    number = np.arange(counts.max())
    columns = np.minimum(low[:, None] + number, len(along) - 1)
    t = along[columns] - here[:, None]
    columns %= count
    weights = weights[columns] * (number < counts[:, None])
    bent = (counts > 4) & (along[low + counts - 1] - along[low] > 2)
    middles, ways = _parabolas(t, weights, bent, ring[columns])
    size = hypot(*ways.T)
    still = size < 1e-9
    ways[still] = (ring[np.minimum(places + 1, count - 1)] - ring[places - 1])[still]
    size = np.where(still, hypot(*ways.T), size)
    return middles, ways / np.maximum(size, 1e-9)[:, None]


def _parabolas(t: Floats, weights: Floats, bent: Bools, points: Floats) -> tuple[Floats, Floats]:
    """Values and slopes at 0 of the parabolas, or where not ``bent`` lines, of least squares through points.

    By polynomials of ``t`` that are orthogonal.

    Args:
        t: of the points, shape (place, point).
        weights: of the squared errors, the same shape.
        bent: shape (place,).
        points: shape (place, point, 2).
    """
    weight = weights.sum(axis=1)
    middle = (weights * t).sum(axis=1) / weight
    t = t - middle[:, None]
    once = weights * t
    spread = (once * t).sum(axis=1)
    # Points in one place say no direction, nor do two places say a bend.
    spread = np.where(spread > RANK * weight, spread, np.inf)
    lean, level = (once * t * t).sum(axis=1) / spread, (once * t).sum(axis=1) / weight
    square = t * t - lean[:, None] * t - level[:, None]
    twice = weights * square
    bend = (twice * square).sum(axis=1)
    bend = np.where(bent & (bend > RANK * (once * t * t * t).sum(axis=1)), bend, np.inf)
    values, slopes = [], []
    for axis in (0, 1):
        own = points[..., axis]
        mean = (weights * own).sum(axis=1) / weight
        slope = (once * own).sum(axis=1) / spread
        curve = (twice * own).sum(axis=1) / bend
        values.append(mean - slope * middle + curve * (middle * middle + lean * middle - level))
        slopes.append(slope - curve * (2 * middle + lean))
    return np.stack(values, axis=1), np.stack(slopes, axis=1)


def _choose(spans: list[_Span], tolerance: float) -> list[Pieces]:
    """The cheapest chain of each span."""
    pairs = [
        np.stack([np.full(len(i), number), i, j], axis=1)
        for number, span in enumerate(spans)
        for i, j in [np.triu_indices(len(span.knots), 1)]
    ]
    if not pairs:
        return []
    every = np.concatenate(pairs)
    parts = [_candidates(spans, every[low : low + CHUNK]) for low in range(0, len(every), CHUNK)]
    cubics = np.concatenate([part[0] for part in parts])
    cubic_error = np.concatenate([part[1] for part in parts])
    line_error = np.concatenate([part[2] for part in parts])
    chosen, low = [], 0
    for span, pair in zip(spans, pairs, strict=True):
        high = low + len(pair)
        chosen.append(
            _chain(
                span, pair[:, 1:], cubics[low:high], cubic_error[low:high], line_error[low:high], tolerance
            )
        )
        low = high
    return chosen


def _chain(
    span: _Span, pairs: Ints, cubics: Floats, cubic_error: Floats, line_error: Floats, tolerance: float
) -> Pieces:
    """Shortest path over the knots."""
    neighbours = pairs[:, 1] - pairs[:, 0] == 1

    def costs(error: Floats, base: float) -> Floats:
        cost = base + ERROR_COST * (error / tolerance) ** 2
        return np.where(error <= tolerance, cost, np.inf)

    as_line = costs(line_error, LINE_COST)
    as_cubic = costs(cubic_error, CUBIC_COST)
    # What is between two neighbouring knots is taken whatever its error.
    as_cubic = np.where(neighbours & ~np.isfinite(as_cubic), 2 * CUBIC_COST, as_cubic)
    cost = np.minimum(as_line, as_cubic).tolist()
    count = len(span.knots)
    best, back = [np.inf] * count, [-1] * count
    best[0] = 0.0
    for number, (i, j) in enumerate(pairs.tolist()):  # ascending in i, so that best[i] is final
        total = best[i] + cost[number]
        if total < best[j]:
            best[j], back[j] = total, number
    picked = []
    knot = count - 1
    while knot > 0:
        picked.append(back[knot])
        knot = int(pairs[back[knot], 0])
    picked.reverse()
    lines = as_line[picked] <= as_cubic[picked]
    curves = cubics[picked].copy()
    for k in np.flatnonzero(lines).tolist():
        curves[k] = straight(curves[k, 0], curves[k, 3])
    return Pieces(curves, lines)


def _candidates(spans: list[_Span], pairs: Ints) -> tuple[Floats, Floats, Floats]:
    """A cubic for each pair of knots, its largest error and that of a straight line."""
    starts, ends, ways, backs, samples = [], [], [], [], []
    firsts = np.flatnonzero(np.diff(pairs[:, 0], prepend=-1))
    for first, rows in zip(firsts.tolist(), np.split(pairs[:, 1:], firsts[1:]), strict=True):
        span = spans[int(pairs[first, 0])]
        starts.append(span.knots[rows[:, 0]])
        ends.append(span.knots[rows[:, 1]])
        ways.append(span.tangents[rows[:, 0]])
        backs.append(-span.tangents[rows[:, 1]])
        low, high = span.places[rows[:, 0]], span.places[rows[:, 1]]
        where = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, SAMPLES)[None]
        left = np.minimum(where.astype(np.intp), len(span.points) - 2)
        share = (where - left)[..., None]
        samples.append(span.points[left] * (1 - share) + span.points[left + 1] * share)
    start, end = np.concatenate(starts), np.concatenate(ends)
    way, back = np.concatenate(ways), np.concatenate(backs)
    points = np.concatenate(samples)
    # Towards a knot its own place counts, not the noisy point there.
    points[:, 0], points[:, -1] = start, end
    chord = end - start
    size = np.maximum(hypot(*chord.T), 1e-9)
    away = points - start[:, None]
    line = np.abs(away[..., 0] * chord[:, None, 1] - away[..., 1] * chord[:, None, 0]).max(axis=1) / size
    along = (away * chord[:, None]).sum(axis=2) / size[:, None]
    line = np.maximum(
        line, np.maximum(-along, along - size[:, None]).max(axis=1)
    )  # turns back beyond its ends
    line = np.where(size < 1e-6, np.inf, line)
    cubics, error = fit_cubics(start, way, back, end, points)
    return cubics, error, line


def fit_cubics(
    start: Floats, way: Floats, back: Floats, end: Floats, points: Floats
) -> tuple[Floats, Floats]:
    """Cubics of given ends and tangents nearest to points (Schneider 1990), and their largest distances.

    Args:
        start: shape (cubic, 2).
        way: unit tangent there.
        back: at the end, pointing back.
        end: shape (cubic, 2).
        points: shape (cubic, sample, 2).
    """
    steps = hypot(*np.moveaxis(np.diff(points, axis=1), 2, 0))
    t = np.concatenate([np.zeros((len(points), 1)), np.cumsum(steps, axis=1)], axis=1)
    t /= np.maximum(t[:, -1:], 1e-9)
    cubics: Floats = np.zeros((len(points), 4, 2))
    for turn in range(TURNS):
        cubics = _with_handles(start, way, back, end, points, t)
        if turn + 1 < TURNS:
            t = _nearer(cubics, points, t)
    off = hypot(*np.moveaxis(_at(cubics, t) - points, 2, 0))
    return cubics, off.max(axis=1)


def _with_handles(start: Floats, way: Floats, back: Floats, end: Floats, points: Floats, t: Floats) -> Floats:
    """The handles by least squares, in the directions given."""
    s = 1 - t
    near_start, near_end = s * s * (1 + 2 * t), t * t * (3 - 2 * t)
    b1, b2 = 3 * s * s * t, 3 * s * t * t
    a11, a22 = (b1 * b1).sum(axis=1), (b2 * b2).sum(axis=1)
    a12 = (b1 * b2).sum(axis=1) * (way * back).sum(axis=1)
    y1, y2 = np.zeros(len(t)), np.zeros(len(t))
    for axis in (0, 1):
        rest = points[..., axis] - near_start * start[:, None, axis] - near_end * end[:, None, axis]
        y1 += (b1 * rest).sum(axis=1) * way[:, axis]
        y2 += (b2 * rest).sum(axis=1) * back[:, axis]
    det = a11 * a22 - a12**2
    safe = np.where(np.abs(det) > 1e-9, det, 1)
    first, second = (a22 * y1 - a12 * y2) / safe, (a11 * y2 - a12 * y1) / safe
    chord = hypot(*(end - start).T)
    bad = (np.abs(det) <= 1e-9) | (first < 0.02 * chord) | (second < 0.02 * chord)
    bad |= (first > 3 * chord) | (second > 3 * chord)
    first, second = np.where(bad, chord / 3, first), np.where(bad, chord / 3, second)
    return np.stack([start, start + first[:, None] * way, end + second[:, None] * back, end], axis=1)


def _at(cubics: Floats, t: Floats) -> Floats:
    s = 1 - t
    weights = s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t
    return np.stack(
        [sum(w * cubics[:, k, axis, None] for k, w in enumerate(weights)) for axis in (0, 1)], axis=-1
    )


def _nearer(cubics: Floats, points: Floats, t: Floats) -> Floats:
    """Parameters of nearer points: a step of Newton's method."""
    hodograph = 3 * np.diff(cubics, axis=1)
    second = 2 * np.diff(hodograph, axis=1)
    s = 1 - t
    away = _at(cubics, t) - points
    slope, along = np.zeros_like(t), np.zeros_like(t)
    for axis in (0, 1):
        h, c, off = hodograph[:, :, axis, None], second[:, :, axis, None], away[..., axis]
        speed = s * s * h[:, 0] + 2 * s * t * h[:, 1] + t * t * h[:, 2]
        slope += speed * speed + off * (s * c[:, 0] + t * c[:, 1])
        along += off * speed
    step = along / np.where(np.abs(slope) > 1e-9, slope, 1)
    moved = np.clip(t - np.clip(step, -0.1, 0.1), 0, 1)
    moved[:, 0], moved[:, -1] = 0, 1
    return np.maximum.accumulate(moved, axis=1)


def _tidied(pieces: Pieces, closed: bool, tolerance: float) -> Pieces:
    """Lines that are nearly horizontal or vertical are made so."""
    cubics, lines = pieces.cubics.copy(), pieces.lines
    count = len(cubics)
    for k in np.flatnonzero(lines).tolist():
        way = cubics[k, 3] - cubics[k, 0]
        for axis in (0, 1):
            limit = min(1.2 * tolerance, FLAT_SLOPE * abs(way[1 - axis]) + 0.02)
            if 0 < abs(way[axis]) <= limit and abs(way[1 - axis]) > 1.5:
                value = 0.5 * (cubics[k, 0, axis] + cubics[k, 3, axis])
                before, after = (k - 1) % count, (k + 1) % count
                if closed or k > 0:
                    _shift(cubics, before, 3, axis, value)
                if closed or k + 1 < count:
                    _shift(cubics, after, 0, axis, value)
                cubics[k, :, axis] = value
    for k in np.flatnonzero(lines).tolist():
        cubics[k] = straight(cubics[k, 0], cubics[k, 3])
    return Pieces(cubics, lines)


def _shift(cubics: Floats, piece: int, end: int, axis: int, value: float) -> None:
    """Move an end of a cubic along with its handle."""
    handle = 2 if end == 3 else 1
    cubics[piece, handle, axis] += value - cubics[piece, end, axis]
    cubics[piece, end, axis] = value
