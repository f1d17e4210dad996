"""Cubics in double precision: functions of the kernels beside this file."""

from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

TINY = wp.constant(wp.float64(1.0e-12))

corners: Any = wp.types.matrix(shape=(4, 2), dtype=wp.float64)
"""The control points, or the coefficients of the polynomial, lowest first."""


@wp.func
def polynomial(cubics: wp.array[wp.vec2d], index: wp.int32) -> corners:
    """Return the coefficients of a cubic."""
    a = cubics[4 * index]
    b = cubics[4 * index + 1]
    c = cubics[4 * index + 2]
    d = cubics[4 * index + 3]
    p = wp.float64(3.0) * (b - a)
    q = wp.float64(3.0) * (c - wp.float64(2.0) * b + a)
    r = d - wp.float64(3.0) * c + wp.float64(3.0) * b - a
    return corners(a[0], a[1], p[0], p[1], q[0], q[1], r[0], r[1])


@wp.func
def point_at(f: corners, t: wp.float64) -> wp.vec2d:
    """Return the point at ``t``."""
    return wp.vec2d(
        ((f[3, 0] * t + f[2, 0]) * t + f[1, 0]) * t + f[0, 0],
        ((f[3, 1] * t + f[2, 1]) * t + f[1, 1]) * t + f[0, 1],
    )


@wp.func
def slope_at(f: corners, t: wp.float64) -> wp.vec2d:
    """Return the derivative by ``t``."""
    return wp.vec2d(
        (wp.float64(3.0) * f[3, 0] * t + wp.float64(2.0) * f[2, 0]) * t + f[1, 0],
        (wp.float64(3.0) * f[3, 1] * t + wp.float64(2.0) * f[2, 1]) * t + f[1, 1],
    )


@wp.func
def nearest_at(f: corners, place: wp.vec2d, start: wp.float64, rounds: wp.int32) -> wp.float64:
    """Return where in [0, 1] a cubic is nearest to ``place``, by steps of Newton's method from ``start``."""
    t = start
    for _ in range(rounds):
        away = point_at(f, t) - place
        speed = slope_at(f, t)
        bend = wp.vec2d(
            wp.float64(6.0) * f[3, 0] * t + wp.float64(2.0) * f[2, 0],
            wp.float64(6.0) * f[3, 1] * t + wp.float64(2.0) * f[2, 1],
        )
        second = wp.dot(speed, speed) + wp.max(wp.dot(away, bend), wp.float64(0.0))
        t = wp.clamp(t - wp.dot(away, speed) / wp.max(second, TINY), wp.float64(0.0), wp.float64(1.0))
    return t
