"""Cubics fitted to points, many at once.

Arrays have a column for each cubic, so that sums over its points are sums of rows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpsplat.drawing.trace.beziers import points_at
from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import hypot

ROUNDS = 3  # of fitting handles and finding the parameters of the points

SAMPLES = 12  # on each of two cubics that become one


def handles_through(first: Floats, second: Floats) -> Floats:
    """Return the handles of the cubics nearest to two that follow one another, shape (..., 2, 2).

    They begin and end where those do, in the same directions; the lengths are fitted by least squares.

    ``first`` and ``second``, which begins where ``first`` ends, have shape (..., 4, 2).
    """
    one, other = first.reshape(-1, 4, 2), second.reshape(-1, 4, 2)
    t = np.arange(SAMPLES + 1) / SAMPLES
    points = np.concatenate([points_at(one, t), points_at(other, t[1:])], axis=1)
    start, end, ahead, back = one[:, 0], other[:, 3], _begun(one), _begun(other[:, ::-1])
    lengths, _ = fit_handles(ahead.T, back.T, *(points - start[:, None]).transpose(2, 1, 0))
    handles = np.stack([start + lengths[0][:, None] * ahead, end + lengths[1][:, None] * back], axis=1)
    return handles.reshape(*first.shape[:-2], 2, 2)


def _begun(cubics: Floats) -> Floats:
    """Return the unit vectors in which cubics, shape (cubic, 4, 2), begin; 0 without extent."""
    ways = cubics[:, 1:] - cubics[:, :1]
    lengths = hypot(ways[..., 0], ways[..., 1])
    first = np.arange(len(cubics)), (lengths > 1e-6).argmax(axis=1)
    return np.where(
        lengths[first][:, None] > 1e-6, ways[first] / np.maximum(lengths[first], 1e-6)[:, None], 0
    )


def fit_handles(ahead: Floats, back: Floats, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Fit cubics of given ends and tangents to points (Schneider 1990).

    Args:
        ahead: Unit tangents at the start, which is the origin, shape (2, cubic).
        back: Unit tangents at the end, pointing back, shape (2, cubic).
        x: Of the points, the first at the start and the last at the end; shape (sample, cubic).
        y: The same.

    Returns:
        The lengths of the handles, shape (2, cubic), and the largest distances from the points.
    """
    t = np.zeros_like(x)
    np.cumsum(hypot(np.diff(x, axis=0), np.diff(y, axis=0)), axis=0, out=t[1:])
    t /= np.maximum(t[-1], 1e-9)
    for number in range(ROUNDS):
        handles = _handles(ahead, back, x, y, t)
        curves = [_coefficients(handles, ahead[axis], back[axis], own[-1]) for axis, own in enumerate((x, y))]
        off = [((c * t + b) * t + a) * t - own for (a, b, c), own in zip(curves, (x, y), strict=True)]
        if number < ROUNDS - 1:
            t = _nearer(t, curves, off)
    return handles, np.sqrt((off[0] * off[0] + off[1] * off[1]).max(axis=0))


def _handles(ahead: Floats, back: Floats, x: Floats, y: Floats, t: Floats) -> Floats:
    """Return the lengths of handles by least squares, a third of the chord where that fails."""
    s = 1 - t
    both, near_end = s * t, t * t * (3 - 2 * t)
    b1, b2 = 3 * both * s, 3 * both * t
    a11, a22 = (b1 * b1).sum(axis=0), (b2 * b2).sum(axis=0)
    a12 = (b1 * b2).sum(axis=0) * (ahead * back).sum(axis=0)
    rest_x, rest_y = x - near_end * x[-1], y - near_end * y[-1]
    y1 = (b1 * rest_x).sum(axis=0) * ahead[0] + (b1 * rest_y).sum(axis=0) * ahead[1]
    y2 = (b2 * rest_x).sum(axis=0) * back[0] + (b2 * rest_y).sum(axis=0) * back[1]
    det = a11 * a22 - a12**2
    is_safe = np.abs(det) > 1e-9
    handles = np.stack([a22 * y1 - a12 * y2, a11 * y2 - a12 * y1]) / np.where(is_safe, det, 1)
    chord = hypot(x[-1], y[-1])
    is_good = is_safe & (handles > 0).all(axis=0)
    return np.where(is_good, handles, chord / 3)


def _coefficients(handles: Floats, ahead: Floats, back: Floats, end: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the coefficients of t, its square and its cube in one coordinate."""
    one, other = 3 * handles[0] * ahead, 3 * (end + handles[1] * back)
    return one, other - 2 * one, end + one - other


def _nearer(t: Floats, curves: Sequence[tuple[Floats, ...]], off: Sequence[Floats]) -> Floats:
    """Return parameters nearer to points, by a step of Newton's method.

    Args:
        t: Shape (sample, cubic).
        curves: The coefficients of each coordinate.
        off: The cubics minus the points there, shape (sample, cubic) each.
    """
    first, second = np.zeros_like(t), np.zeros_like(t)
    for away, (a, b, c) in zip(off, curves, strict=True):
        speed = (3 * c * t + 2 * b) * t + a
        first += away * speed
        second += speed * speed + away * (6 * c * t + 2 * b)
    step = first / np.where(np.abs(second) > 1e-9, second, 1)
    moved = np.clip(t - np.clip(step, -0.1, 0.1), 0, 1)
    moved[0], moved[-1] = 0, 1
    return np.maximum.accumulate(moved, axis=0)
