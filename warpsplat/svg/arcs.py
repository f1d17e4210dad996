"""Cubic Béziers as arcs of circles or as straight lines, within a tolerance.

A curve becomes a biarc: two arcs that have its tangents at its ends, and a common one where they meet. One
that is too far from its biarc is halved (Meek and Walton, "Approximation of discrete data by G1
arc splines", 1992).

A bulge is the tangent of a quarter of an arc's angle, positive if it turns left: this is how DXF has arcs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from warpsplat.scene import Bools, Floats

SAMPLES = np.arange(1, 8) / 8
"""Where distances are measured, in the parameter of a curve."""


class Vertices(NamedTuple):
    """The vertices of a polyline with arcs."""

    points: Floats
    """Where lines and arcs begin and, last, where the last one ends, shape (vertex, 2)."""
    bulges: Floats
    """The bulge from each to the next, 0 for lines, shape (vertex - 1,)."""


def as_lines(curves: Floats, tolerance: float) -> Vertices:
    """Return a chain of cubics, shape (cubic, 4, 2), as straight lines, equally many parameters apart.

    The distance is at most an eighth of the largest second derivative over the square of their number.
    """
    counts = np.maximum(1, np.ceil(np.sqrt(_sagging(curves) / tolerance))).astype(np.intp)
    points = [curves[:1, 0]]
    for curve, count in zip(curves, counts.tolist(), strict=True):
        points.append(points_at(curve[None], np.arange(1, count) / count)[0] if count > 1 else curve[:0])
        points.append(curve[3:])
    joined = np.concatenate(points)
    return Vertices(joined, np.zeros(len(joined) - 1))


def as_arcs(curves: Floats, tolerance: float) -> Vertices:
    """Return a chain of cubics, shape (cubic, 4, 2), as arcs and lines."""
    start = curves[0, 0]
    places = np.arange(len(curves), dtype=np.float64)  # of the ends of arcs, in order along the chain
    size, found = 1.0, []
    straight = 1e-3  # largest distance from a line, over the tolerance, at which a curve is one
    # A curve that was halved so often is a millionth as long, and becomes a line, whatever it is.
    most_halvings = 20
    for halving in range(most_halvings + 1):
        made = _biarcs(curves, tolerance)
        is_line = _sagging(curves) <= (straight * tolerance if halving < most_halvings else np.inf)
        single, double = is_line | made.is_one, made.is_close & ~is_line & ~made.is_one
        found += [
            (places[single] + size, curves[single, 3], np.where(is_line, 0.0, made.whole)[single]),
            (places[double] + size / 2, made.joints[double], made.first[double]),
            (places[double] + size, curves[double, 3], made.second[double]),
        ]
        left = ~(single | double)
        size /= 2
        places = np.concatenate([places[left], places[left] + size])
        curves = np.concatenate(_halves(curves[left]))
        if not len(curves):
            break
    where, ends, bulges_to = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(where, kind="stable")
    return Vertices(np.concatenate([start[None], ends[order]]), bulges_to[order])


def _sagging(curves: Floats) -> Floats:
    """Return a bound of the distance of cubics from their chords, shape (cubic,)."""
    second = np.diff(curves, 2, axis=1)
    return 0.75 * np.sqrt((second * second).sum(axis=2)).max(axis=1)


def points_at(curves: Floats, t: Floats) -> Floats:
    """Return the points of cubics at some parameters, shape (cubic, parameter, 2)."""
    s = 1 - t
    weights = np.stack([s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t])[:, None, :, None]
    return np.asarray(sum(weights[i] * curves[:, i, None] for i in range(4)))


def _halves(curves: Floats) -> tuple[Floats, Floats]:
    """Return the first and second halves of cubics (de Casteljau)."""
    a, b, c, d = (curves[:, i] for i in range(4))
    ab, bc, cd = (a + b) / 2, (b + c) / 2, (c + d) / 2
    abc, bcd = (ab + bc) / 2, (bc + cd) / 2
    middle = (abc + bcd) / 2
    return np.stack([a, ab, abc, middle], axis=1), np.stack([middle, bcd, cd, d], axis=1)


def _tangents(curves: Floats) -> Floats:
    """Return the directions of cubics at their starts, shape (cubic, 2); zero if all points are one."""
    found = np.zeros((len(curves), 2))
    for i in (3, 2, 1):
        step = curves[:, i] - curves[:, 0]
        length = np.sqrt((step * step).sum(axis=1))
        is_long = length > 1e-12
        found[is_long] = step[is_long] / length[is_long, None]
    return found


class _Biarcs(NamedTuple):
    """The biarcs of cubics; what does not exist is not finite, and not close."""

    joints: Floats
    """Shape (cubic, 2)."""
    first: Floats
    """Bulges of the first arcs, shape (cubic,)."""
    second: Floats
    whole: Floats
    """Bulges of both arcs as one."""
    is_close: Bools
    """Whether both are within the tolerance."""
    is_one: Bools
    """Whether one arc is, with nearly the curve's tangents."""


def _biarcs(curves: Floats, tolerance: float) -> _Biarcs:
    """Return the biarcs whose tangents, from the ends to where they meet, are equally long at both ends."""
    start, end, chord = curves[:, 0], curves[:, 3], curves[:, 3] - curves[:, 0]
    first, last = _tangents(curves), -_tangents(curves[:, ::-1])
    both = _dot(chord, first + last)
    square = _dot(chord, chord)
    kink = 1e-3  # largest difference of bulges at both ends of a curve that one arc replaces: 0.2 degrees
    # The bulge of an arc of 106 degrees; a longer one may run round the wrong side of its curve.
    largest_bulge = 0.5
    with np.errstate(all="ignore"):
        reach = square / (both + np.sqrt(both * both + 2 * (1 - _dot(first, last)) * square))
        joint = (start + end + reach[:, None] * (first - last)) / 2
        halves = joint - start, end - joint
        bulges = _bulge(first, halves[0]), _bulge(halves[1], last)
        across = end - start - reach[:, None] * (first + last)  # along the tangent at the joint
        samples = points_at(curves, SAMPLES)
        is_first = ((samples - joint[:, None]) * across[:, None]).sum(axis=2) < 0
        offs = (_offs(samples, start, halves[0], bulges[0]), _offs(samples, joint, halves[1], bulges[1]))
        is_short = (np.abs(bulges[0]) <= largest_bulge) & (np.abs(bulges[1]) <= largest_bulge) & (reach > 0)
        is_close = is_short & (np.abs(np.where(is_first, *offs)).max(axis=1) <= tolerance)
        ends = _bulge(first, chord), _bulge(chord, last)
        whole = (bulges[0] + bulges[1]) / (1 - bulges[0] * bulges[1])
        is_one = is_short & (np.abs(ends[0] - ends[1]) <= kink) & (np.abs(whole) <= largest_bulge)
        is_one &= np.abs(_offs(samples, start, chord, whole)).max(axis=1) <= tolerance
    return _Biarcs(joint, *bulges, whole, is_close, is_one)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray((a * b).sum(axis=-1))


def _bulge(a: Floats, b: Floats) -> Floats:
    """Return the tangent of half the angle from ``a`` to ``b``, of which one is a unit vector."""
    lengths = np.sqrt(_dot(a, a) * _dot(b, b))
    return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / (lengths + _dot(a, b))


def _offs(points: Floats, start: Floats, chord: Floats, bulge: Floats) -> Floats:
    """Return the distances of points (arc, point, 2) from the circles of arcs, shape (arc, point).

    They are exact on the circle, and without cancellation where it is nearly a line.
    """
    y = points - start[:, None]
    length = np.sqrt(_dot(chord, chord))[:, None]
    height = y[..., 1] * chord[:, None, 0] - y[..., 0] * chord[:, None, 1]
    b = bulge[:, None]
    power = 2 * b * (_dot(y, y) - _dot(y, chord[:, None])) + (b * b - 1) * height
    return power / (length * (1 + b * b))
