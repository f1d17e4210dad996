"""Béziers and index arithmetic: ``@wp.func`` only, callable from plain Python for tests."""

from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


control_points: Any = wp.types.matrix(shape=(4, 2), dtype=wp.float32)
"""The control points of a cubic, a row each."""


@wp.struct
class Contour:
    """Where a contour's control points and Béziers are."""

    shape: wp.int32
    basis: wp.int32  # CUBIC or SPLINE
    closed: wp.int32
    first: wp.int32  # control point
    count: wp.int32  # of these
    bezier: wp.int32  # its first
    beziers: wp.int32  # their number


@wp.func
def cubic_weights(t: wp.float32) -> wp.vec4:
    """Return the four cubic Bernstein weights at ``t`` in [0, 1] (paper eq. 2, M = 3); they sum to 1."""
    s = 1.0 - t
    return wp.vec4(s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t)


@wp.func
def fair_weights(t: wp.float32, pieces: wp.int32) -> wp.vec4:
    """Return weights of the vertex at ``t`` of a cubic flattened to ``pieces`` chords of equal steps h of t.

    A chord with both ends on the curve lies h^2/8 |B''| inside at most, h^2/12 |B''| in the mean. Vertices
    moved out by that mean, B - h^2/12 B'', leave a polyline that is off by it at its vertices and by half of
    it between them, on either side in turn: it encloses what the curve encloses.
    """
    s = 1.0 - t
    shift = 0.5 / (float(pieces) * float(pieces))
    curved = wp.vec4(s, 3.0 * t - 2.0, 1.0 - 3.0 * t, t)
    return cubic_weights(t) - shift * curved


@wp.func
def chain_end(at_end: wp.bool) -> wp.float32:
    """Return the share of the outer point in an end of a spline's quadratic: half, or all of it at a stroke's
    end.
    """
    if at_end:
        return 1.0
    return 0.5


@wp.func
def bezier_points(points: wp.array[wp.vec2], contour: Contour, local: wp.int32) -> control_points:
    """Return Bézier ``local`` of a contour as a cubic: of a spline, its quadratic in a higher degree."""
    first = contour.first
    count = contour.count
    if contour.basis == constants.CUBIC:
        i = first + 3 * local
        last = i + 3
        if 3 * local + 3 == count:
            last = first
        a = points[i]
        b = points[i + 1]
        c = points[i + 2]
        d = points[last]
        return control_points(a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1])
    before = local - 1
    if contour.closed == 0:
        before = local
    middle = points[first + (before + 1) % count]
    share = chain_end(contour.closed == 0 and local == 0)
    start = share * points[first + (before + count) % count] + (1.0 - share) * middle
    share = chain_end(contour.closed == 0 and local == count - 3)
    end = share * points[first + (before + 2) % count] + (1.0 - share) * middle
    b = (start + 2.0 * middle) / 3.0
    c = (end + 2.0 * middle) / 3.0
    return control_points(start[0], start[1], b[0], b[1], c[0], c[1], end[0], end[1])


@wp.func
def add_bezier_grad(grad: control_points, contour: Contour, local: wp.int32, points_grad: wp.array[wp.vec2]):
    """Adjoint of ``bezier_points``: add ``grad`` to the contour's control points."""
    first = contour.first
    count = contour.count
    if contour.basis == constants.CUBIC:
        for j in range(4):
            i = first + (3 * local + j) % count
            points_grad[i] = points_grad[i] + grad[j]
        return
    before = local - 1
    if contour.closed == 0:
        before = local
    start = chain_end(contour.closed == 0 and local == 0) * (grad[0] + grad[1] / 3.0)
    end = chain_end(contour.closed == 0 and local == count - 3) * (grad[3] + grad[2] / 3.0)
    i = first + (before + count) % count
    points_grad[i] = points_grad[i] + start
    i = first + (before + 1) % count
    points_grad[i] = points_grad[i] + (grad[0] + grad[1] + grad[2] + grad[3] - start - end)
    i = first + (before + 2) % count
    points_grad[i] = points_grad[i] + end


@wp.func
def point_weight(contour: Contour, local: wp.int32, j: wp.int32, w: wp.vec4) -> wp.float32:
    """Return the weight of control point ``j`` of Bézier ``local`` where its cubic's have the weights ``w``,
    which sum to 1: the adjoint of ``bezier_points``.
    """
    if contour.basis == constants.CUBIC:
        return w[j]
    before = chain_end(contour.closed == 0 and local == 0) * (w[0] + w[1] / 3.0)
    after = chain_end(contour.closed == 0 and local == contour.count - 3) * (w[3] + w[2] / 3.0)
    if j == 0:
        return before
    if j == 2:
        return after
    return 1.0 - before - after


@wp.func
def cross(a: wp.vec2, b: wp.vec2) -> wp.float32:
    """Return the signed area of the parallelogram of ``a`` and ``b``."""
    return a[0] * b[1] - a[1] * b[0]
