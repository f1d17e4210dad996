"""Forms that are a fixed outline, stretched along two perpendicular axes, turned and moved.

The values are the centre, half of the first axis as a vector, and half of the second axis with a 0.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import warp as wp

from warpsplat.forms import Array
from warpsplat.kernels import constants
from warpsplat.kernels.forms import Rows, make_gather, make_place
from warpsplat.portable import elementary

HANDLE = 4 * (math.sqrt(2) - 1) / 3
"""Handles of the cubic nearest to a quarter of a circle, over its radius."""

QUARTERS = np.array(
    [
        *([1, 0], [1, HANDLE], [HANDLE, 1]),
        *([0, 1], [-HANDLE, 1], [-1, HANDLE]),
        *([-1, 0], [-1, -HANDLE], [-HANDLE, -1]),
        *([0, -1], [HANDLE, -1], [1, -HANDLE]),
    ]
)
"""Control points of the unit circle, shape (point, 2)."""

COARSE = 86
"""Half of an axis, in units of the file, up to which whole degrees move its end by less than a unit."""


def table_of(outline: Array) -> Any:
    """Return an outline, shape (point, 2), as a constant of kernels."""
    kind: Any = wp.types.matrix(shape=outline.shape, dtype=wp.float32)
    return wp.constant(kind(*outline.ravel().tolist()))


def placed(values: Array, outline: Array) -> Array:
    """Return the control points of shapes with an outline of shape (point, 2)."""
    centre, first, half = values[:, :1], values[:, 1], values[:, 2, 0]
    length = np.maximum(np.sqrt((first * first).sum(axis=1)), constants.EPSILON)
    second = np.stack([-first[:, 1], first[:, 0]], axis=1) * (half / length)[:, None]
    x, y = (outline[:, i].astype(values.dtype)[None, :, None] for i in (0, 1))
    return np.asarray(centre + x * first[:, None] + y * second[:, None])


def make_frame(name: str, outline: Array) -> tuple[wp.Kernel, wp.Kernel]:
    """Return the kernels of the form with an outline of shape (point, 2), see ``kernels.forms``."""
    table = table_of(outline)

    @wp.func(name=f"{name}_point", module="unique")
    def point(values: Rows, first: int, count: int, k: int):
        """Return where a point of the outline lies."""
        along = values[first + 1]
        share = values[first + 2][0] / wp.max(wp.length(along), constants.EPSILON)
        return values[first] + table[k, 0] * along + (share * table[k, 1]) * wp.vec2(-along[1], along[0])

    @wp.func(name=f"{name}_adjoint", module="unique")
    def adjoint(values: Rows, first: int, count: int, j: int, points_grad: Rows, start: int, drawn: int):
        """Return the gradient of the centre, the first axis u, or half of the second one, b.

        The second axis is b n, where n is the first one's direction e, turned: dn = -e (n . du) / |u|.
        """
        centre = wp.vec2(0.0, 0.0)
        along = wp.vec2(0.0, 0.0)
        across = wp.vec2(0.0, 0.0)
        for k in range(drawn):
            grad = points_grad[start + k]
            centre += grad
            along += table[k, 0] * grad
            across += table[k, 1] * grad
        if j == 0:
            return centre
        length = wp.max(wp.length(values[first + 1]), constants.EPSILON)
        e = values[first + 1] / length
        n = wp.vec2(-e[1], e[0])
        if j == 1:
            return along - (values[first + 2][0] * wp.dot(across, e) / length) * n
        return wp.vec2(wp.dot(across, n), 0.0)

    return make_place(name, point), make_gather(name, adjoint)


def start_frames(centres: Array, halves: Array, angles: Array) -> Array:
    """Return the values of shapes with equal axes of half lengths ``halves``."""
    along = halves[:, None] * np.stack([elementary.cos(angles), elementary.sin(angles)], axis=1)
    return np.stack([centres, along, np.stack([halves, 0 * halves], axis=1)], axis=1)


def axes(values: Array) -> tuple[Array, Array, Array]:
    """Return angles from -45 to 45 degrees, and half of the axis nearest to level and of the other one."""
    x, y = values[:, 1].T
    first, second = np.sqrt(x * x + y * y), np.abs(values[:, 2, 0])
    degrees = np.degrees(elementary.arctan2(y, x))
    quarters = np.round(degrees / 90 - np.sign(degrees) * 1e-6)  # 45 degrees stay
    turned = quarters % 2 == 1
    return degrees - 90 * quarters, np.where(turned, second, first), np.where(turned, first, second)


def rounded_angles(degrees: Array, longest: Array) -> Array:
    """Return angles in whole degrees, or in tenths or hundredths for long axes; ``longest`` are rounded."""
    step = np.where(longest <= COARSE, 1, np.where(longest <= 10 * COARSE, 10, 100))
    return np.asarray(np.round(degrees * step) / step)


def turned_back(points: Array, degrees: Array) -> Array:
    """Return points, shape (shape, 2), in coordinates that are turned by ``degrees`` themselves."""
    angles = np.radians(degrees)
    cosine, sine = elementary.cos(angles), elementary.sin(angles)
    x, y = points.T
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)


def frames_of(centres: Array, first: Array, second: Array, degrees: Array) -> Array:
    """Return the values of shapes, with centres in turned coordinates (``turned_back``)."""
    angles, none = np.radians(degrees), np.zeros_like(first)
    along = first[:, None] * np.stack([elementary.cos(angles), elementary.sin(angles)], axis=1)
    return np.stack([turned_back(centres, -degrees), along, np.stack([second, none], axis=1)], axis=1)
