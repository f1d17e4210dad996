"""Where cubics cross each other, or themselves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warpsplat.scene.scene import Floats, IndexArray, ranges

LEVELS = 3
"""Times that cubics whose boxes meet are split into four parts; lines take the place of these."""

CHUNK = 1 << 17
"""Pairs that are looked at together."""


def parts(cubics: Floats, start: Floats, end: Floats) -> Floats:
    """Return the part of each cubic, shape (cubic, 4, 2), between two parameters, shape (cubic,)."""

    def at(*places: Floats) -> Floats:
        points = cubics
        for t in places:
            points = points[:, :-1] + t[:, None, None] * (points[:, 1:] - points[:, :-1])
        return points[:, 0]

    found = [at(start, start, start), at(start, start, end), at(start, end, end), at(end, end, end)]
    return np.stack(found, axis=1)


def places(pieces: int) -> Floats:
    """Return the parameters where the lines end that take the place of a cubic, shape (pieces + 1,).

    They are no simple fractions: symmetric shapes often cross at these, where neither line would.
    """
    shift = 0.382  # by how much of a line the first one of a cubic is longer, and the last one shorter
    found = (np.arange(pieces + 1) + shift) / pieces
    found[0], found[-1] = 0, 1
    return found


def flattened(cubics: Floats, pieces: int = 1 << 2 * LEVELS) -> Floats:
    """Return cubics as lines: (cubic, 4, 2) -> (cubic, pieces + 1, 2)."""
    t = places(pieces)[:, None]
    s = 1 - t
    a, b, c, d = (cubics[:, None, i] for i in range(4))
    found = np.asarray(s * s * s * a + 3 * s * s * t * b + 3 * s * t * t * c + t * t * t * d)
    found[:, 0], found[:, -1] = cubics[:, 0], cubics[:, 3]  # exactly, as ends that meet do not cross
    return found


def intersections(cubics: Floats) -> tuple[IndexArray, Floats]:
    """Return which cubics (cubic, 4, 2) cross one another, or themselves, and where.

    That is pairs of indices, shape (crossing, 2), and the parameters there, in [0, 1], of the same shape.
    Ends on one another are no crossings.
    """
    pairs, t = _loops(cubics)
    found, where = [pairs], [t]
    lines = flattened(cubics)
    low, high = np.minimum(lines[:, :-1], lines[:, 1:]), np.maximum(lines[:, :-1], lines[:, 1:])
    boxes = [
        (low.reshape(len(low), count, -1, 2).min(axis=2), high.reshape(len(low), count, -1, 2).max(axis=2))
        for count in (4 << 2 * level for level in range(LEVELS))
    ]
    for near in _near(lines.min(axis=1), lines.max(axis=1)):
        pairs, t = _crossing(lines, boxes, near)
        found.append(pairs)
        where.append(t)
    return np.concatenate(found), np.concatenate(where)


def _loops(cubics: Floats) -> tuple[IndexArray, Floats]:
    """Return which cubics cross themselves, and where, as ``intersections``.

    For a t³ + b t² + c t at two parameters with the sum u and the product w, a (u² - w) + b u + c = 0.
    """
    p, q, r, s = (cubics[:, i] for i in range(4))
    a, b, c = s - p + 3 * (q - r), 3 * (p + r - 2 * q), 3 * (q - p)
    bend, square = cross(a, b), (a * a).sum(axis=1)
    possible = (bend != 0) & (square > 0)
    total = -cross(a, c) / np.where(possible, bend, 1)
    rest = -((b * total[:, None] + c) * a).sum(axis=1) / np.where(possible, square, 1)
    apart = 4 * rest - 3 * total * total  # the square of their difference
    half = 0.5 * np.sqrt(np.maximum(apart, 0))
    t = np.stack([0.5 * total - half, 0.5 * total + half], axis=1)
    found = np.flatnonzero(possible & (apart > 0) & (t > 0).all(axis=1) & (t < 1).all(axis=1))
    return np.stack([found, found], axis=1), t[found]


def _near(low: Floats, high: Floats) -> Iterator[IndexArray]:
    """Yield pairs of boxes that meet, shape (pair, 2), some at a time."""
    order = np.argsort(low[:, 0], kind="stable")
    after = np.arange(1, len(order) + 1)
    counts = np.maximum(np.searchsorted(low[order, 0], high[order, 0], "right") - after, 0)
    chunks = np.cumsum(counts) // CHUNK
    for rows in np.split(np.arange(len(order)), np.flatnonzero(np.diff(chunks)) + 1):
        pairs = np.stack(
            [np.repeat(order[rows], counts[rows]), order[ranges(after[rows], counts[rows])]], axis=1
        )
        meet = (low[pairs[:, 0], 1] <= high[pairs[:, 1], 1]) & (low[pairs[:, 1], 1] <= high[pairs[:, 0], 1])
        pairs = pairs[meet]
        step = CHUNK // 16
        yield from (pairs[begin : begin + step] for begin in range(0, len(pairs), step))


def _crossing(
    lines: Floats, boxes: list[tuple[Floats, Floats]], pairs: IndexArray
) -> tuple[IndexArray, Floats]:
    """Return which of ``pairs`` cross, and where, as ``intersections``.

    ``boxes``: lows and highs of 4, 16 ... parts of each cubic, shape (cubic, part, 2).
    """
    own = np.zeros(pairs.shape, np.intp)
    steps = np.stack(np.divmod(np.arange(16), 4), axis=1)
    for low, high in boxes:
        pairs, own = np.repeat(pairs, 16, axis=0), (4 * own[:, None] + steps).reshape(-1, 2)
        (one, other), (i, j) = pairs.T, own.T
        meet = (low[one, i] <= high[other, j]).all(axis=1) & (low[other, j] <= high[one, i]).all(axis=1)
        pairs, own = pairs[meet], own[meet]
    (one, other), (i, j) = pairs.T, own.T
    a, b, c, d = lines[one, i], lines[one, i + 1], lines[other, j], lines[other, j + 1]
    sides = [cross(b - a, c - a), cross(b - a, d - a), cross(d - c, a - c), cross(d - c, b - c)]
    found = (sides[0] * sides[1] < 0) & (sides[2] * sides[3] < 0)
    # Twice the area of a triangle [units²] below which a point lies on a line: more than rounding errors.
    touch = 1e-9
    found &= np.min(np.abs(sides), axis=0, initial=np.inf) > touch
    along = [(x / np.where(found, x - y, 1))[found] for x, y in (sides[2:], sides[:2])]
    t = places(lines.shape[1] - 1)
    own = own[found]
    return pairs[found], t[own] + np.stack(along, axis=1) * (t[own + 1] - t[own])


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of vectors, shape (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
