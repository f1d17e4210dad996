"""Corners of a polyline of sub-pixel points, and where exactly they lie."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import arctan2, hypot
from warpsplat.portable.linear import principal_direction

SCALES = ((4.0, 28.0), (2.2, 50.0))
"""Lengths of outline on both sides that are compared [px], and the least turn of a corner [degrees], besides
what the outline turns beside it: a small circle turns everywhere.
"""

ROUNDED = 1.1
"""Length of outline on each side of a corner that its antialiasing bends [px]."""

SIDE = 6.0
"""Length of outline on each side that tells where a corner is [px]."""

FAR = 4.0
"""How far a corner may lie from the outline's points [px]: the tips of stars do."""

NEAR = 1.2
"""The same of one with short sides."""

BLUNT, SHARP = 3.5, 3.0
"""Length of outline between two corners that may be one [px], and how far that one may be from its middle."""

Corner = tuple[float, Floats]
"""Where along the polyline, and the point."""


def lengths(points: Floats, closed: bool) -> Floats:
    """Arc length at each point and, of a closed polyline, of the whole at last."""
    following = np.roll(points, -1, axis=0) if closed else points[1:]
    steps = hypot(*(following - points[: len(following)]).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def at_length(points: Floats, along: Floats, closed: bool, where: Floats) -> Floats:
    """Points at arc lengths, shape (..., 2); of a closed polyline modulo its length."""
    ring = np.concatenate([points, points[:1]]) if closed else points
    where = where % along[-1] if closed else np.clip(where, 0, along[-1])
    low = np.clip(np.searchsorted(along, where, side="right") - 1, 0, len(along) - 2)
    size = np.diff(along)
    share = (where - along[low]) / np.where(size > 0, size, 1.0)[low]
    return np.asarray(ring[low] + share[..., None] * np.diff(ring, axis=0)[low])


def find_corners(points: Floats, closed: bool, scale: float = 1.0) -> list[Corner]:
    """Corners of a polyline, in order along it.

    Args:
        points: shape (point, 2).
        closed: whether the last joins the first.
        scale: factor of the lengths that are compared; larger for coarser outlines.
    """
    along = lengths(points, closed)
    total = float(along[-1])
    here = along[: len(points)]
    strength = np.zeros(len(points))
    for scale_px, least in SCALES:
        reach = min(scale_px * scale, total / 6)
        if reach < 1.2:
            continue
        before, turn, after = _turns(points, along, closed, here, reach)
        way = np.sign(turn)
        # The other way, the next corner of a stair turns.
        excess = np.abs(turn) - 0.5 * (np.maximum(way * before, 0) + np.maximum(way * after, 0))
        if not closed:
            excess[(here < reach * 0.6) | (here > total - reach * 0.6)] = 0
        strength = np.maximum(strength, excess / least)
    corners = _located(points, along, closed, _peaks(strength, here, total, closed))
    return _blunted(points, along, closed, corners)


def _turns(points: Floats, along: Floats, closed: bool, where: Floats, reach: float) -> Floats:
    """Degrees that the polyline turns ``reach`` before arc lengths, there, and as far after; shape (3, n)."""
    x, y = np.moveaxis(at_length(points, along, closed, where + reach * np.arange(-2, 3)[:, None]), 2, 0)
    x, y = np.diff(x, axis=0), np.diff(y, axis=0)
    cross, dot = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    return np.asarray(np.degrees(arctan2(cross, dot)))


def _peaks(strength: Floats, here: Floats, total: float, closed: bool) -> list[int]:
    """The strongest points, none within 2 px of a stronger one."""
    found: list[int] = []
    candidates = np.flatnonzero(strength >= 1)
    for i in candidates[np.argsort(-strength[candidates], kind="stable")].tolist():
        gaps = np.abs(here[found] - here[i])
        if closed:
            gaps = np.minimum(gaps, total - gaps)
        if not len(gaps) or gaps.min() > 2.0:
            found.append(i)
    return sorted(found)


def _blunted(points: Floats, along: Floats, closed: bool, corners: list[Corner]) -> list[Corner]:
    """Two corners that antialiasing made of one sharp one are one again: their outer sides meet near them."""
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
            point = _meeting(one, _side(points, along, closed, high + 0.5, beyond), middle, SHARP)
            if point is not middle:
                result[number] = ((low + high) / 2 % total if closed else (low + high) / 2, point)
                del result[after]
                continue
        number += 1
    return sorted(result, key=lambda corner: corner[0])


def _located(points: Floats, along: Floats, closed: bool, corners: list[int]) -> list[Corner]:
    total = float(along[-1])
    result = []
    for number, i in enumerate(corners):
        here = float(along[i])
        before = float(along[corners[number - 1]]) if number else -np.inf
        after = float(along[corners[number + 1]]) if number + 1 < len(corners) else np.inf
        if closed:
            before = before if number else float(along[corners[-1]]) - total
            after = after if number + 1 < len(corners) else float(along[corners[0]]) + total
        else:
            before, after = max(before, -ROUNDED), min(after, total + ROUNDED)
        low, high = max(here - SIDE, before + ROUNDED), min(here + SIDE, after - ROUNDED)
        point = _meeting(
            _side(points, along, closed, low, here - ROUNDED),
            _side(points, along, closed, here + ROUNDED, high),
            points[i],
            FAR if min(here - low, high - here) > 0.6 * SIDE else NEAR,
        )
        result.append((here, point))
    return result


def _side(
    points: Floats, along: Floats, closed: bool, low: float, high: float
) -> tuple[Floats, Floats] | None:
    """A point of a side and its direction; None where there is too little of it."""
    if high - low < 1.5:
        return None
    part = at_length(points, along, closed, np.linspace(low, high, 9))
    return part.mean(axis=0), principal_direction(part)


def _meeting(
    one: tuple[Floats, Floats] | None, other: tuple[Floats, Floats] | None, near: Floats, far: float
) -> Floats:
    """Where two sides meet; ``near`` where they do not, or farther away from it than ``far`` [px]."""
    if one is None or other is None:
        return near
    (x, y), (other_x, other_y), (away_x, away_y) = one[1], other[1], other[0] - one[0]
    cross = x * other_y - y * other_x
    if abs(cross) < 0.2:
        return near
    point = one[0] + (away_x * other_y - away_y * other_x) / cross * one[1]
    return np.asarray(point if hypot(*(point - near)) <= far else near)
