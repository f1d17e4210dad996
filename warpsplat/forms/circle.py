"""Circles: the values are the centre, and the radius with a 0."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpsplat.forms import Array
from warpsplat.forms.frame import QUARTERS, table_of
from warpsplat.forms.text import element_of
from warpsplat.kernels.forms import Rows, make_gather, make_place

VALUES = 2
TAGS = ("circle",)
TURNED = False

AROUND = table_of(QUARTERS)


def outline(values: Array, closed: bool) -> Array:
    """Return four arcs, from the right clockwise."""
    return values[:, :1] + values[:, 1:, :1] * QUARTERS.astype(values.dtype)


@wp.func
def point(values: Rows, first: int, count: int, k: int):
    """Return a control point of an arc."""
    return values[first] + values[first + 1][0] * wp.vec2(AROUND[k, 0], AROUND[k, 1])


@wp.func
def adjoint(values: Rows, first: int, count: int, j: int, points_grad: Rows, start: int, drawn: int):
    """Return the gradient of the centre, or of the radius."""
    total = wp.vec2(0.0, 0.0)
    for k in range(drawn):
        grad = points_grad[start + k]
        if j == 0:
            total += grad
        else:
            total += wp.vec2(AROUND[k, 0] * grad[0] + AROUND[k, 1] * grad[1], 0.0)
    return total


place = make_place("circle", point)
gather = make_gather("circle", adjoint)


def start(centres: Array, areas: Array, angles: Array, count: int) -> Array:
    """Return circles of these areas."""
    radii = np.sqrt(areas / np.pi)
    return np.stack([centres, np.stack([radii, 0 * radii], axis=1)], axis=1)


def numbers(values: Array) -> Array:
    """Return centre and radius."""
    radii = np.maximum(np.round(np.abs(values[:, 1, :1])), 1)
    return np.concatenate([np.round(values[:, 0]), radii], axis=1)


def values(numbers: Array) -> Array:
    """Return centre and radius as values."""
    return np.stack([numbers[:, :2], numbers[:, 2:] * [1, 0]], axis=1)


def element(numbers: list[float], closed: bool) -> str:
    """Return a circle."""
    return element_of("circle", zip(("cx", "cy", "r"), numbers, strict=True))


def read(points: Array, closed: bool) -> Array:
    """Return the circle through the ends of the arcs."""
    centre = points[::3].mean(axis=0)
    x, y = points[0] - centre
    return np.array([centre, (np.sqrt(x * x + y * y), 0)])
