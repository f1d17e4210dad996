"""Fills cut by a convex polygon: what a nested viewport leaves of them."""

from __future__ import annotations

import numpy as np

from warpsplat.svg.paths import Points, Subpath, line

TOLERANCE = 1e-6
"""Distance [px] from a line within which a point lies on it."""


def cut_subpath(subpath: Subpath, corners: Points) -> Subpath | None:
    """A closed subpath of a fill within a convex polygon; None if nothing is left.

    Side by side (Sutherland and Hodgman): what lies beyond a side becomes a straight line along it, so that
    the windings inside stay what they were.

    Args:
        subpath: what to cut; one that is open is closed by a straight line.
        corners: of the polygon, counted so that its inside lies to the left of its sides, shape (corner, 2).
    """
    chain = _cubics(subpath.points)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way = (b - a) / np.hypot(*(b - a))
        chain = _cut(chain, a, np.array([-way[1], way[0]]))
        if not chain:
            return None
    points = np.concatenate([chain[0][:1], *(cubic[1:] for cubic in chain)])
    return Subpath(points, True, False)


def _cubics(points: Points) -> list[Points]:
    cubics = [points[i : i + 4] for i in range(0, len(points) - 1, 3)]
    if not np.allclose(points[-1], points[0], rtol=0, atol=TOLERANCE):
        cubics.append(_straight(points[-1], points[0]))
    return cubics


def _straight(start: Points, end: Points) -> Points:
    return np.array([start, *((z.real, z.imag) for z in line(complex(*start), complex(*end)))])


def _cut(chain: list[Points], at: Points, inward: Points) -> list[Points]:
    """The part of a closed chain of cubics where ``(point - at) . inward`` is not negative."""
    kept: list[Points] = []
    for cubic in chain:
        for piece in _split(cubic, (cubic - at) @ inward):
            if ((piece - at) @ inward @ [1, 3, 3, 1]) < -8 * TOLERANCE:
                continue  # the middle lies outside
            if kept and not np.allclose(kept[-1][-1], piece[0], rtol=0, atol=TOLERANCE):
                kept.append(_straight(kept[-1][-1], piece[0]))
            kept.append(piece)
    if kept and not np.allclose(kept[-1][-1], kept[0][0], rtol=0, atol=TOLERANCE):
        kept.append(_straight(kept[-1][-1], kept[0][0]))
    return kept


def _split(cubic: Points, heights: Points) -> list[Points]:
    """A cubic in pieces each on one side of a line that its points are ``heights`` above."""
    a, b, c, d = heights
    if (heights >= -TOLERANCE).all() or (heights <= TOLERANCE).all():
        return [cubic]
    roots = np.roots([d - 3 * c + 3 * b - a, 3 * (c - 2 * b + a), 3 * (b - a), a])
    cuts = sorted(float(t.real) for t in roots if abs(t.imag) < 1e-9 and 1e-9 < t.real < 1 - 1e-9)
    pieces, start = [], 0.0
    for t in cuts:
        left, cubic = _halves(cubic, (t - start) / (1 - start))
        pieces.append(left)
        start = t
    return [*pieces, cubic]


def _halves(cubic: Points, t: float) -> tuple[Points, Points]:
    """Both parts of a cubic, cut at ``t`` (de Casteljau)."""
    rows = [cubic]
    while len(rows[-1]) > 1:
        rows.append(rows[-1][:-1] + t * (rows[-1][1:] - rows[-1][:-1]))
    return np.array([row[0] for row in rows]), np.array([row[-1] for row in reversed(rows)])
