"""Corners of polylines of sub-pixel points, and where exactly they lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, at_pixels
from warpsplat.drawing.trace.polylines import Polylines
from warpsplat.portable.elementary import arctan2, hypot
from warpsplat.portable.filters import box_blur
from warpsplat.portable.linear import principal_direction
from warpsplat.scene.scene import ranges

REACH, LEAST_TURN = 2.5, 28.0
"""Length of outline on both sides that is compared [px], and the least turn of a corner [degrees], besides
what an outline turns beside it: a small circle turns everywhere."""

STEP, APART = 0.25, 8
"""From one place that may be a corner to the next [px], and how many of them lie between two corners."""

BENT, SIDE = 1.5, 3.0
"""Length of outline on each side of a corner that antialiasing bends, and beside that of its sides [px]."""

MOST_AREA = 0.18  # by which a corner and its outline differ in a pixel
SHARES = np.linspace(0, 1, 17)  # of a part of an outline: its points from which areas and lines are measured


@dataclass(frozen=True)
class Corners:
    """Corners of polylines, by polyline and in order along each."""

    owner: Ints
    """The polyline that each is of, shape (corner,)."""
    along: Floats
    """The arc length where it lies, shape (corner,)."""
    points: Floats
    """Its point, shape (corner, 2)."""


def find_corners(lines: Polylines, scales: Floats, doubt: Floats | None = None) -> Corners:
    """Return the corners of polylines.

    Args:
        lines: Of sub-pixel points.
        scales: Factor of the lengths that are compared, larger for coarser outlines; shape (polyline,).
        doubt: How far off areas of pixels may be, shape (height, width); None: not at all.
    """
    counts = np.ceil(lines.totals / STEP).astype(np.intp)
    owner, number = np.repeat(np.arange(len(counts)), counts), ranges(np.zeros_like(counts), counts)
    size, total, closed = counts[owner], lines.totals[owner], lines.closed[owner]
    here = number / size * total
    reach = np.minimum(REACH * scales, lines.totals / 6)[owner]
    before, turn, after = _turns(lines.at(owner[:, None], here[:, None] + reach[:, None] * np.arange(-2, 3)))
    sign = np.sign(turn)
    # The next corner of a staircase turns the other way.
    excess = np.abs(turn) - 0.5 * (np.maximum(sign * before, 0) + np.maximum(sign * after, 0))
    is_inner = closed | (np.minimum(here, total - here) >= reach * 0.6)
    strength = np.where(is_inner, excess, 0)
    is_peak = strength >= LEAST_TURN
    for away in range(1, APART + 1):
        for side in (-away, away):
            place = np.where(closed, (number + side) % size, np.clip(number + side, 0, size - 1))
            beside = strength[place + np.arange(len(owner)) - number]
            is_peak &= (strength > beside) if side > 0 else (strength >= beside)
    return _located(lines, owner[is_peak], here[is_peak], doubt)


def _turns(points: Floats) -> Floats:
    """Return the degrees by which outlines turn at the inner ones of points (n, point, 2), (point - 2, n)."""
    x, y = np.diff(points, axis=1).T
    cross, dot = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    return np.asarray(np.degrees(arctan2(cross, dot)))


def _located(lines: Polylines, owner: Ints, here: Floats, doubt: Floats | None) -> Corners:
    """Return the corners near arc lengths where their sides meet and the pixels keep their areas."""
    total, closed = lines.totals[owner], lines.closed[owner]
    # Nothing lies beyond the ends of an open polyline, and beyond half a closed one the other side.
    low, high = np.where(closed, here - total / 2, 0), np.where(closed, here + total / 2, total)
    begin, end = np.maximum(here - BENT, (low + here) / 2), np.minimum(here + BENT, (high + here) / 2)
    before, after = np.maximum(begin - SIDE, low), np.minimum(end + SIDE, high)
    near, outlines = lines.at(owner, here), _between(lines, owner, begin, end)
    tips, met = _meetings(_between(lines, owner, before, begin), _between(lines, owner, end, after))
    slack = np.zeros(len(owner)) if doubt is None else at_pixels(box_blur(doubt, 3), near)
    tips = _with_area(outlines, np.where(met[:, None], tips, near), slack)
    kept = np.flatnonzero(met & (_most_changed(outlines, tips) - slack <= MOST_AREA))
    owner, here, tips = owner[kept], here[kept], tips[kept]
    again = (np.diff(owner) == 0) & (hypot(*np.diff(tips, axis=0).T) < STEP * APART / 2)
    kept = np.append(True, ~again)[: len(owner)]
    return Corners(owner[kept], here[kept], tips[kept])


def _between(lines: Polylines, owner: Ints, low: Floats, high: Floats) -> Floats:
    """Return points of outlines evenly from one arc length to another, shape (n, point, 2)."""
    return lines.at(owner[:, None], low[:, None] + (high - low)[:, None] * SHARES)


def _meetings(one: Floats, other: Floats) -> tuple[Floats, Bools]:
    """Return where the lines through points (corner, point, 2) meet, and whether they do at an angle."""
    (x, y), (other_x, other_y) = principal_direction(one).T, principal_direction(other).T
    middles = one.mean(axis=1)
    away_x, away_y = (other.mean(axis=1) - middles).T
    cross = x * other_y - y * other_x
    met = np.abs(cross) >= 0.2
    along = (away_x * other_y - away_y * other_x) / np.where(met, cross, 1)
    return middles + along[:, None] * np.stack([x, y], axis=1), met


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
    shares = SHARES[1:, None]
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
