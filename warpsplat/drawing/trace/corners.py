"""Corners of a polyline of sub-pixel points, and where exactly they lie."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.drawing.trace.polylines import arc_lengths, at_length
from warpsplat.portable.elementary import arctan2, hypot
from warpsplat.portable.linear import principal_direction

SCALES = ((4.0, 28.0), (2.2, 50.0))
"""Lengths of outline on both sides that are compared [px], and the least turn of a corner [degrees], besides
what the outline turns beside it: a small circle turns everywhere.
"""

LEAST_REACH = 1.2  # [px] of outline on each side, below which nothing is compared
APART = 2.0  # [px] of outline between two corners, at the least

Corner = tuple[float, Floats]
"""The arc length where a corner lies, and its point."""

ROUNDED = 1.1  # [px] of outline on each side of a corner that its antialiasing bends
SIDE = 6.0  # [px] of outline on each side that tells where a corner is
MOST_OFF, MOST_OFF_SHORT = 4.0, 1.2  # [px] of a corner with long and short sides: the tips of stars are off
BLUNT = 3.5  # [px] of outline between two corners that may be one
MOST_OFF_BLUNT = 3.0  # [px] distance of that one from their middle, at the most


def find_corners(points: Floats, closed: bool, scale: float = 1.0) -> list[Corner]:
    """Return the corners of a polyline, in order along it.

    Args:
        points: Shape (point, 2).
        closed: Whether the last joins the first.
        scale: Factor of the lengths that are compared; larger for coarser outlines.
    """
    along = arc_lengths(points, closed=closed)
    total = float(along[-1])
    here = along[: len(points)]
    strength = np.zeros(len(points))
    for length, least in SCALES:
        reach = min(length * scale, total / 6)
        if reach < LEAST_REACH:
            continue
        before, turn, after = _turns(points, along, closed, here, reach)
        sign = np.sign(turn)
        # The next corner of a staircase turns the other way.
        excess = np.abs(turn) - 0.5 * (np.maximum(sign * before, 0) + np.maximum(sign * after, 0))
        if not closed:
            excess[(here < reach * 0.6) | (here > total - reach * 0.6)] = 0
        strength = np.maximum(strength, excess / least)
    corners = _located(points, along, closed, _peaks(strength, here, total, closed))
    return _with_sharp_tips(points, along, closed, corners)


def _turns(points: Floats, along: Floats, closed: bool, where: Floats, reach: float) -> Floats:
    """Return the degrees that the polyline turns ``reach`` before arc lengths, there and after, (3, n)."""
    x, y = np.moveaxis(at_length(points, along, closed, where + reach * np.arange(-2, 3)[:, None]), 2, 0)
    x, y = np.diff(x, axis=0), np.diff(y, axis=0)
    cross, dot = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    return np.asarray(np.degrees(arctan2(cross, dot)))


def _peaks(strength: Floats, here: Floats, total: float, closed: bool) -> list[int]:
    """Return the strongest points, none of them close to a stronger one."""
    found: list[int] = []
    candidates = np.flatnonzero(strength >= 1)
    for i in candidates[np.argsort(-strength[candidates], kind="stable")].tolist():
        gaps = np.abs(here[found] - here[i])
        if closed:
            gaps = np.minimum(gaps, total - gaps)
        if not len(gaps) or gaps.min() > APART:
            found.append(i)
    return sorted(found)


def _located(points: Floats, along: Floats, closed: bool, corners: list[int]) -> list[Corner]:
    """Return corners where their two sides meet."""
    total = float(along[-1])
    where = [float(along[i]) for i in corners]
    if closed:
        around = [where[-1] - total, *where, where[0] + total] if where else []
    else:
        around = [-ROUNDED, *where, total + ROUNDED]
    result = []
    for number, i in enumerate(corners):
        before, here, after = around[number : number + 3]
        low, high = max(here - SIDE, before + ROUNDED), min(here + SIDE, after - ROUNDED)
        point = _meeting(
            _side(points, along, closed, low, here - ROUNDED),
            _side(points, along, closed, here + ROUNDED, high),
            points[i],
            MOST_OFF if min(here - low, high - here) > 0.6 * SIDE else MOST_OFF_SHORT,
        )
        result.append((here, point))
    return result


def _with_sharp_tips(points: Floats, along: Floats, closed: bool, corners: list[Corner]) -> list[Corner]:
    """Return corners with one for each two that antialiasing made of it: their outer sides meet near them."""
    total = float(along[-1])
    result = list(corners)
    number = 0
    while number < len(result) - (not closed) and len(result) > 2:
        after = (number + 1) % len(result)
        low, high = result[number][0], result[after][0] + (total if after < number + 1 else 0.0)
        if high - low < BLUNT:
            before, beyond = low - SIDE, high + SIDE
            if not closed:
                before, beyond = max(before, 0.0), min(beyond, total)
            middle = at_length(points, along, closed, np.array([(low + high) / 2]))[0]
            one = _side(points, along, closed, before, low - 0.5)
            point = _meeting(one, _side(points, along, closed, high + 0.5, beyond), middle, MOST_OFF_BLUNT)
            if point is not middle:
                result[number] = ((low + high) / 2 % total if closed else (low + high) / 2, point)
                del result[after]
                continue
        number += 1
    return sorted(result, key=lambda corner: corner[0])


def _side(
    points: Floats, along: Floats, closed: bool, low: float, high: float
) -> tuple[Floats, Floats] | None:
    """Return a point of a side and its direction; None where it is too short."""
    if high - low < 1.5:
        return None
    part = at_length(points, along, closed, np.linspace(low, high, 9))
    return part.mean(axis=0), principal_direction(part)


def _meeting(
    one: tuple[Floats, Floats] | None, other: tuple[Floats, Floats] | None, near: Floats, far: float
) -> Floats:
    """Return where two sides meet; ``near`` where they do not, or farther away from it than ``far`` [px]."""
    if one is None or other is None:
        return near
    (x, y), (other_x, other_y), (away_x, away_y) = one[1], other[1], other[0] - one[0]
    cross = x * other_y - y * other_x
    if abs(cross) < 0.2:
        return near
    point = one[0] + (away_x * other_y - away_y * other_x) / cross * one[1]
    return np.asarray(point if hypot(*(point - near)) <= far else near)
