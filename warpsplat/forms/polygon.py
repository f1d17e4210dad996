"""Polygons, and open chains of straight lines: the values are the vertices."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpsplat.forms import Array
from warpsplat.forms.text import element_of, text_of
from warpsplat.kernels.forms import Rows, make_gather, make_place
from warpsplat.portable import elementary

VALUES = 0
TAGS = ("polygon", "polyline", "line")
TURNED = False


def outline(values: Array, closed: bool) -> Array:
    """Return the sides as cubics with handles at the thirds."""
    following = np.roll(values, -1, axis=1)
    pieces = [values, (2 * values + following) / 3, (values + 2 * following) / 3]
    ring = np.stack(pieces, axis=2).reshape(len(values), -1, 2)
    return ring if closed else ring[:, :-2]


@wp.func
def point(values: Rows, first: int, count: int, k: int):
    """Return a vertex, or a point at a third of a side."""
    i = k / 3
    share = float(k - 3 * i) / 3.0
    return (1.0 - share) * values[first + i] + share * values[first + (i + 1) % count]


@wp.func
def adjoint(values: Rows, first: int, count: int, j: int, points_grad: Rows, start: int, drawn: int):
    """Return the gradient of a vertex by the points of its two sides."""
    total = points_grad[start + 3 * j]
    if 3 * j + 2 < drawn:
        total += (2.0 * points_grad[start + 3 * j + 1] + points_grad[start + 3 * j + 2]) / 3.0
    before = 3 * ((j + count - 1) % count)
    if before + 2 < drawn:
        total += (points_grad[start + before + 1] + 2.0 * points_grad[start + before + 2]) / 3.0
    return total


place = make_place("polygon", point)
gather = make_gather("polygon", adjoint)


def start(centres: Array, areas: Array, angles: Array, count: int) -> Array:
    """Return regular polygons."""
    turns = angles[:, None] + 2 * np.pi / count * np.arange(count)
    radii = np.sqrt(areas / (0.5 * count * elementary.sin(2 * np.pi / count)))
    around = np.stack([elementary.cos(turns), elementary.sin(turns)], axis=2)
    return np.asarray(centres[:, None] + radii[:, None, None] * around)


def numbers(values: Array) -> Array:
    """Return the rounded vertices."""
    return np.round(values).reshape(len(values), -1)


def values(numbers: Array) -> Array:
    """Return the vertices."""
    return numbers.reshape(len(numbers), -1, 2)


def element(numbers: list[float], closed: bool) -> str:
    """Return a polygon, a line, or a polyline."""
    if len(numbers) == 4 and not closed:
        return element_of("line", zip(("x1", "y1", "x2", "y2"), numbers, strict=True))
    pairs = zip(numbers[::2], numbers[1::2], strict=True)
    text = " ".join(f"{text_of(x)} {text_of(y)}".replace(" -", "-") for x, y in pairs)
    return f'{"polygon" if closed else "polyline"} points="{text}"'


def read(points: Array, closed: bool) -> Array:
    """Return the ends of the sides."""
    return points[::3]
