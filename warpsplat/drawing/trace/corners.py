"""Corners of polylines of sub-pixel points, and where exactly they lie."""

from __future__ import annotations

import bisect
import itertools
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.polylines import Polylines
from warpsplat.portable.elementary import arctan2, hypot
from warpsplat.portable.linear import principal_direction
from warpsplat.scene.scene import ranges

SCALES = ((4.0, 28.0), (2.2, 50.0))
"""Lengths of outline on both sides that are compared [px], and the least turn of a corner [degrees], besides
what the outline turns beside it: a small circle turns everywhere.
"""

LEAST_REACH = 1.2  # [px] of outline on each side, below which nothing is compared
LEAST_POINTS = 5  # of a polyline with corners
APART = 2.0  # [px] of outline between two corners, at the least

BENT = 2.0, 1.0
"""Lengths of outline on each side of a corner that its antialiasing may bend [px]."""

SIDES = 5.0, 2.0
"""Lengths of outline beside these that may tell where the corner lies [px]."""

SIDE_SAMPLES = 9  # points of a side that tell its direction
LEAST_SIDE = 0.5  # [px] of outline that has a direction
MOST_OFF = 4.0  # [px] of a corner from its outline: the tips of stars are off
MOST_AREA = (
    0.18  # by which a corner and its outline differ in a pixel; logos: nothing changes from 0.1 to 0.2
)
SAMPLES = 17  # points of an outline around a corner from which these areas are measured
BLUNT = 3.5  # [px] of outline between two corners that may be one


@dataclass(frozen=True)
class Corners:
    """Corners of polylines, by polyline and in order along each."""

    owner: Ints
    """The polyline that each is of, shape (corner,)."""
    along: Floats
    """The arc length where it lies, shape (corner,)."""
    points: Floats
    """Its point, shape (corner, 2)."""
    bent: Floats
    """The length of outline on each side that is not part of its sides, shape (corner,)."""


def find_corners(lines: Polylines, scales: Floats, doubt: Floats | None = None) -> Corners:
    """Return the corners of polylines.

    Args:
        lines: Of sub-pixel points.
        scales: Factor of the lengths that are compared, larger for coarser outlines; shape (polyline,).
        doubt: How far off areas of pixels may be, shape (height, width); None: not at all.
    """
    strength = np.zeros(len(lines.points))
    for length, least in SCALES:
        reach = np.minimum(length * scales, lines.totals / 6)
        compared = np.flatnonzero((reach >= LEAST_REACH) & (lines.counts >= LEAST_POINTS))
        which = np.repeat(compared, lines.counts[compared])
        index = ranges(lines.first[compared], lines.counts[compared])
        here, reach = lines.along[index], reach[which]
        before, turn, after = _turns(lines, which, here, reach)
        sign = np.sign(turn)
        # The next corner of a staircase turns the other way.
        excess = np.abs(turn) - 0.5 * (np.maximum(sign * before, 0) + np.maximum(sign * after, 0))
        at_end = (here < reach * 0.6) | (here > lines.totals[which] - reach * 0.6)
        excess[at_end & ~lines.closed[which]] = 0
        strength[index] = np.maximum(strength[index], excess / least)
    return _located(lines, _peaks(lines, strength), BLUNT * scales, doubt)


def _turns(lines: Polylines, which: Ints, where: Floats, reach: Floats) -> Floats:
    """Return the degrees that polylines turn ``reach`` before arc lengths, there and after, (3, n)."""
    x, y = np.stack([lines.at(which, where + reach * step) for step in range(-2, 3)]).transpose(2, 0, 1)
    x, y = np.diff(x, axis=0), np.diff(y, axis=0)
    cross, dot = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    return np.asarray(np.degrees(arctan2(cross, dot)))


def _peaks(lines: Polylines, strength: Floats) -> Ints:
    """Return the strongest points, none of them close to a stronger one of its polyline, in order."""
    candidates = np.flatnonzero(strength >= 1)
    owner = np.searchsorted(lines.first, candidates, side="right") - 1
    order = np.lexsort((-strength[candidates], owner))
    candidates, owner = candidates[order], owner[order]
    found: list[int] = []
    kept: list[float] = []  # where corners were found on the ``last`` polyline
    last, around = -1, 0.0
    places = zip(candidates.tolist(), owner.tolist(), lines.along[candidates].tolist(), strict=True)
    for candidate, polyline, here in places:
        if polyline != last:
            last, kept = polyline, []
            around = float(lines.totals[polyline]) if lines.closed[polyline] else np.inf
        place = bisect.bisect(kept, here)
        before = kept[place - 1] if place else (kept[-1] - around if kept else -np.inf)
        after = kept[place] if place < len(kept) else (kept[0] + around if kept else np.inf)
        if here - before > APART and after - here > APART:
            kept.insert(place, here)
            found.append(candidate)
    return np.asarray(sorted(found), np.intp)


def _located(lines: Polylines, peaks: Ints, blunt: Floats, doubt: Floats | None) -> Corners:
    """Return corners at peaks where the pixels keep their areas.

    Antialiasing may have made two peaks of a corner: two nearer than ``blunt`` are one if they may be.
    """
    owner, here = np.searchsorted(lines.first, peaks, side="right") - 1, lines.along[peaks]
    total, closed = lines.totals[owner], lines.closed[owner]
    after = _following(owner)
    wraps = after <= np.arange(len(peaks))
    following = here[after] + np.where(wraps, total, 0)
    near = (following - here < blunt[owner]) & (following > here)
    pairs = np.flatnonzero(near & (closed | ~wraps))
    other = after[pairs]
    which = np.append(owner, owner[pairs])
    first, last = np.append(here, here[pairs]), np.append(here, following[pairs])
    points, off, bent = _meeting(lines, which, first, last, doubt)
    bent += (last - first) / 2
    kept = off <= MOST_AREA
    joined = np.flatnonzero(kept[len(peaks) :]) + len(peaks)
    free = np.ones(len(peaks), np.bool_)
    for pair in joined[np.argsort(off[joined], kind="stable")].tolist():
        both = [pairs[pair - len(peaks)], other[pair - len(peaks)]]
        kept[pair] = free[both].all()
        if kept[pair]:
            kept[both], free[both] = False, False
    along = (first + last) / 2
    along = np.where(lines.closed[which], along % np.maximum(lines.totals[which], 1e-9), along)
    order = np.lexsort((along, which))
    order = order[kept[order]]
    near = hypot(*np.diff(points[order], axis=0).T) < APART / 2
    order = order[np.append(True, ~near | (np.diff(which[order]) != 0))[: len(order)]]
    return Corners(which[order], along[order], points[order], bent[order])


def _mean_around(values: Floats, points: Floats) -> Floats:
    """Return the mean of the values (height, width) of the nine pixels around points, shape (point,)."""
    height, width = values.shape
    x, y = np.floor(points).astype(np.intp).T
    around = [(y + down, x + right) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    inside = [(row.clip(0, height - 1), column.clip(0, width - 1)) for row, column in around]
    return np.asarray(np.mean([values[place] for place in inside], axis=0))


def _meeting(
    lines: Polylines, owner: Ints, first: Floats, last: Floats, doubt: Floats | None
) -> tuple[Floats, Floats, Floats]:
    """Return where the sides of corners meet, how much the area of a pixel changes then, and what is bent.

    Which part of its outline antialiasing has bent, and how long its sides are straight, is tried.

    Args:
        lines: Of sub-pixel points.
        owner: The polyline of each corner, shape (corner,).
        first: The arc length where it begins, shape (corner,).
        last: The arc length where it ends, shape (corner,).
        doubt: As for ``find_corners``.

    Returns:
        Points, shape (corner, 2); the largest area beyond doubt [px^2], infinite where no sides meet; the
        length of outline on each side that is bent; shape (corner,) each.
    """
    middle, total, closed = (first + last) / 2, lines.totals[owner], lines.closed[owner]
    # Nothing lies beyond the ends of an open polyline, and beyond half a closed one the other side.
    low, high = np.where(closed, middle - total / 2, 0), np.where(closed, middle + total / 2, total)
    best = np.full(len(owner), np.inf)
    near = lines.at(owner, middle)
    bend = np.full(len(owner), BENT[-1])
    points, slack = near.copy(), np.zeros(len(owner)) if doubt is None else _mean_around(doubt, near)
    for side, bent in itertools.product(SIDES, BENT):
        begin, end = np.maximum(first - bent, (low + first) / 2), np.minimum(last + bent, (last + high) / 2)
        tips, met = _meetings(
            _sides(lines, owner, np.maximum(begin - side, low), begin),
            _sides(lines, owner, end, np.minimum(end + side, high)),
            near,
        )
        where = begin[:, None] + (end - begin)[:, None] * np.linspace(0, 1, SAMPLES)
        outline = lines.at(np.repeat(owner, SAMPLES), where.reshape(-1)).reshape(-1, SAMPLES, 2)
        tips = _with_area(outline, tips, slack)
        off = np.where(met, np.maximum(_most_changed(outline, tips) - slack, 0), np.inf)
        better = off < best
        best[better], points[better], bend[better] = off[better], tips[better], bent
    return points, best, bend


def _with_area(outlines: Floats, tips: Floats, slack: Floats) -> Floats:
    """Return tips so far out that going straight to them and back covers about the area of outlines.

    Args:
        outlines: Shape (corner, point, 2).
        tips: Shape (corner, 2).
        slack: By how much each of the two pixels at a tip may be off, shape (corner,).
    """
    x, y = np.moveaxis(outlines, 2, 0)
    area = (x[:, :-1] * y[:, 1:] - x[:, 1:] * y[:, :-1]).sum(axis=1) + x[:, -1] * y[:, 0] - x[:, 0] * y[:, -1]
    chord, ahead = outlines[:, -1] - outlines[:, 0], tips - (outlines[:, 0] + outlines[:, -1]) / 2
    now = ahead[:, 0] * chord[:, 1] - ahead[:, 1] * chord[:, 0]
    lack = area - now
    lack -= np.clip(lack, -2 * slack, 2 * slack)
    factor = np.clip(lack / np.where(now == 0, np.inf, now), -0.5, 0.5)
    return np.asarray(tips + factor[:, None] * ahead)


def _most_changed(outlines: Floats, tips: Floats) -> Floats:
    """Return by how much areas of pixels change if outlines go straight to tips and back; shape (corner,).

    Args:
        outlines: Of close points, shape (corner, point, 2).
        tips: Shape (corner, 2).

    Returns:
        The largest change [px^2].
    """
    shares = np.linspace(0, 1, SAMPLES)[1:, None]
    ends, starts, tips = outlines[:, -1:], outlines[:, :1], tips[:, None]
    rings = np.concatenate([outlines, ends + (tips - ends) * shares, tips + (starts - tips) * shares], axis=1)
    middles, down = (rings[:, 1:] + rings[:, :-1]) / 2, np.diff(rings[..., 1], axis=1)
    cells = np.floor(middles).astype(np.intp)
    right = middles[..., 0] - cells[..., 0]
    cells -= cells.min(axis=1, keepdims=True)
    width, height = cells.reshape(-1, 2).max(axis=0, initial=0) + 2
    at = ((np.arange(len(rings))[:, None] * height + cells[..., 1]) * width + cells[..., 0]).reshape(-1)
    # Of each step down or up, a part of its own pixel lies to the right of it, and all of those beyond.
    steps = np.bincount(at, (down * (1 - right)).reshape(-1), len(rings) * height * width)
    steps += np.bincount(at + 1, (down * right).reshape(-1), len(steps))
    return np.abs(steps.reshape(-1, height, width).cumsum(axis=2)).max(axis=(1, 2), initial=0)


def _following(owner: Ints) -> Ints:
    """Return the corner after each one, around its polyline."""
    changes = np.diff(owner) != 0
    is_first, is_last = np.append(True, changes)[: len(owner)], np.append(changes, True)[: len(owner)]
    after = np.arange(1, len(owner) + 1)
    after[is_last] = np.flatnonzero(is_first)
    return after


@dataclass(frozen=True)
class _Sides:
    """Straight parts of outline beside corners."""

    middles: Floats
    """Shape (side, 2)."""
    directions: Floats
    """Unit vectors, shape (side, 2)."""
    known: Bools
    """Whether they are long enough, shape (side,)."""


def _sides(lines: Polylines, owner: Ints, low: Floats, high: Floats) -> _Sides:
    """Return the sides between arc lengths, shape (side,) each."""
    where = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, SIDE_SAMPLES)
    points = lines.at(np.repeat(owner, SIDE_SAMPLES), where.reshape(-1)).reshape(-1, SIDE_SAMPLES, 2)
    return _Sides(points.mean(axis=1), principal_direction(points), high - low >= LEAST_SIDE)


def _meetings(one: _Sides, other: _Sides, near: Floats) -> tuple[Floats, Bools]:
    """Return where sides meet, ``near`` where they do not, and whether they do.

    Args:
        one: Sides before corners.
        other: Those after.
        near: Shape (corner, 2).
    """
    (x, y), (other_x, other_y) = one.directions.T, other.directions.T
    away_x, away_y = (other.middles - one.middles).T
    cross = x * other_y - y * other_x
    met = one.known & other.known & (np.abs(cross) >= 0.2)
    along = (away_x * other_y - away_y * other_x) / np.where(met, cross, 1)
    points = one.middles + along[:, None] * one.directions
    met &= hypot(*(points - near).T) <= MOST_OFF
    return np.where(met[:, None], points, near), met
