"""Corners of polylines of sub-pixel points, and where exactly they lie."""

from __future__ import annotations

import bisect
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

ROUNDED = 1.1  # [px] of outline on each side of a corner that its antialiasing bends
SIDE = 6.0  # [px] of outline on each side that tells where a corner is
SIDE_SAMPLES = 9  # points of a side that tell its direction
LEAST_SIDE = 1.5  # [px] of outline that has a direction
MOST_OFF, MOST_OFF_SHORT = 4.0, 1.2  # [px] of a corner with long and short sides: the tips of stars are off
BLUNT = 3.5  # [px] of outline between two corners that may be one
MOST_OFF_BLUNT = 3.0  # [px] distance of that one from their middle, at the most


@dataclass(frozen=True)
class Corners:
    """Corners of polylines, by polyline and in order along each."""

    owner: Ints
    """The polyline that each is of, shape (corner,)."""
    along: Floats
    """The arc length where it lies, shape (corner,)."""
    points: Floats
    """Its point, shape (corner, 2)."""


def find_corners(lines: Polylines, scale: float = 1.0) -> Corners:
    """Return the corners of polylines.

    Args:
        lines: Of sub-pixel points.
        scale: Factor of the lengths that are compared; larger for coarser outlines.
    """
    strength = np.zeros(len(lines.points))
    for length, least in SCALES:
        reach = np.minimum(length * scale, lines.totals / 6)
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
    return _with_sharp_tips(lines, _located(lines, _peaks(lines, strength)))


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


def _located(lines: Polylines, peaks: Ints) -> Corners:
    """Return corners where their two sides meet."""
    owner, here = np.searchsorted(lines.first, peaks, side="right") - 1, lines.along[peaks]
    total, closed = lines.totals[owner], lines.closed[owner]
    before, after = _neighbours(owner)
    # Before the first corner of a closed polyline lies the last, and beyond an open one nothing.
    beyond = np.where(closed, here[before] - total, -ROUNDED)
    low = np.where(before < np.arange(len(peaks)), here[before], beyond)
    beyond = np.where(closed, here[after] + total, total + ROUNDED)
    high = np.where(after > np.arange(len(peaks)), here[after], beyond)
    low, high = np.maximum(here - SIDE, low + ROUNDED), np.minimum(here + SIDE, high - ROUNDED)
    is_long = np.minimum(here - low, high - here) > 0.6 * SIDE
    points, _ = _meetings(
        _sides(lines, owner, low, here - ROUNDED),
        _sides(lines, owner, here + ROUNDED, high),
        lines.points[peaks],
        np.where(is_long, MOST_OFF, MOST_OFF_SHORT),
    )
    return Corners(owner, here, points)


def _neighbours(owner: Ints) -> tuple[Ints, Ints]:
    """Return the corners before and after each one, around its polyline."""
    number, changes = np.arange(len(owner)), np.diff(owner) != 0
    is_first, is_last = np.append(True, changes)[: len(owner)], np.append(changes, True)[: len(owner)]
    before, after = number - 1, number + 1
    before[is_first], after[is_last] = number[is_last], number[is_first]
    return before, after


def _with_sharp_tips(lines: Polylines, corners: Corners) -> Corners:
    """Return corners with one for each two that antialiasing made of it: their outer sides meet near them."""
    while len(corners.owner):
        owner, along, points = corners.owner, corners.along.copy(), corners.points.copy()
        after = _neighbours(owner)[1]
        wraps = after <= np.arange(len(owner))
        total, closed = lines.totals[owner], lines.closed[owner]
        left = np.bincount(owner)
        near = (along[after] + wraps * total - along < BLUNT) & (closed | ~wraps) & (left[owner] > 2)
        pairs = np.flatnonzero(near)
        low, high = along[pairs], along[after[pairs]] + (wraps * total)[pairs]
        met, middle, tips = _tips(lines, owner[pairs], low, high)
        gone, taken = np.zeros(len(owner), np.bool_), np.zeros(len(owner), np.bool_)
        for number in np.flatnonzero(met).tolist():
            one, other = int(pairs[number]), int(after[pairs[number]])
            if not (taken[one] or taken[other] or left[owner[one]] <= 2):
                taken[[one, other]], gone[other] = True, True
                along[one], points[one] = middle[number], tips[number]
                left[owner[one]] -= 1
        if not gone.any():
            break
        order = np.lexsort((along, owner))
        order = order[~gone[order]]
        corners = Corners(owner[order], along[order], points[order])
    return corners


def _tips(lines: Polylines, owner: Ints, low: Floats, high: Floats) -> tuple[Bools, Floats, Floats]:
    """Return whether what is outside of two corners meets near their middle, that arc length, and where."""
    total, closed = lines.totals[owner], lines.closed[owner]
    before = np.where(closed, low - SIDE, np.maximum(low - SIDE, 0))
    beyond = np.where(closed, high + SIDE, np.minimum(high + SIDE, total))
    middle = (low + high) / 2
    points, met = _meetings(
        _sides(lines, owner, before, low - 0.5),
        _sides(lines, owner, high + 0.5, beyond),
        lines.at(owner, middle),
        np.full(len(owner), MOST_OFF_BLUNT),
    )
    return met, np.where(closed, middle % np.where(closed, total, 1), middle), points


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


def _meetings(one: _Sides, other: _Sides, near: Floats, far: Floats) -> tuple[Floats, Bools]:
    """Return where sides meet, and whether they do; ``near`` where not, or farther away from it than ``far``.

    Args:
        one: Sides before corners.
        other: Those after.
        near: Shape (corner, 2).
        far: [px], shape (corner,).
    """
    (x, y), (other_x, other_y) = one.directions.T, other.directions.T
    away_x, away_y = (other.middles - one.middles).T
    cross = x * other_y - y * other_x
    met = one.known & other.known & (np.abs(cross) >= 0.2)
    along = (away_x * other_y - away_y * other_x) / np.where(met, cross, 1)
    points = one.middles + along[:, None] * one.directions
    met &= hypot(*(points - near).T) <= far
    return np.where(met[:, None], points, near), met
