"""Losses of the shapes with their gradients: Xing and bending."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cross, cubic_end

wp.set_module_options(constants.MODULE_OPTIONS)

EPSILON = wp.constant(constants.EPSILON)


@wp.func
def sine(a: wp.vec2, b: wp.vec2) -> wp.float32:
    """Sine of the angle from ``a`` to ``b``; 0 where either has no length."""
    return cross(a, b) / wp.max(wp.length(a) * wp.length(b), EPSILON)


@wp.kernel
def xing_backward(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    cubic_first: wp.array[wp.int32],  # [shape_count + 1]
    weight: wp.float32,
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] added to
    shape_loss: wp.array[wp.float32],  # [shape_count] sum over the shape's segments, before weight and mean
):
    """Xing loss of LIVE (Ma et al. 2022, eq. 5) of each cubic's control polygon edges v1, v2, v3:
    relu(-sin(v1, v3)) where sin(v1, v2) >= 0, else relu(sin(v1, v3)); the mean over all segments.

    One thread a shape. d sin(a, b) / da = (perp(b) - sin a |b| / |a|) / (|a| |b|), perp(b) = (b_y, -b_x).
    """
    shape = offset + wp.tid()
    factor = weight / float(cubic_first[cubic_first.shape[0] - 1])
    total = float(0.0)
    for cubic in range(cubic_first[shape + 1] - cubic_first[shape]):
        i0 = point_first[shape] + 3 * cubic
        i3 = cubic_end(i0, point_first, shape)
        a = points[i0 + 1] - points[i0]
        middle = points[i0 + 2] - points[i0 + 1]
        b = points[i3] - points[i0 + 2]
        s = sine(a, b)
        sign = float(0.0)  # d loss / d s
        if cross(a, middle) >= 0.0:
            if s < 0.0:
                sign = -1.0
        elif s > 0.0:
            sign = 1.0
        total += sign * s
        length_a = wp.length(a)
        length_b = wp.length(b)
        if sign != 0.0 and length_a * length_b > EPSILON:
            product = length_a * length_b
            k = factor * sign
            a_grad = k * (wp.vec2(b[1], -b[0]) / product - s * a / (length_a * length_a))
            b_grad = k * (wp.vec2(-a[1], a[0]) / product - s * b / (length_b * length_b))
            points_grad[i0] = points_grad[i0] - a_grad
            points_grad[i0 + 1] = points_grad[i0 + 1] + a_grad
            points_grad[i0 + 2] = points_grad[i0 + 2] - b_grad
            points_grad[i3] = points_grad[i3] + b_grad
    shape_loss[shape] = total


@wp.kernel
def bending_backward(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    cubic_first: wp.array[wp.int32],  # [shape_count + 1]
    weight: wp.float32,
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] added to
    shape_loss: wp.array[wp.float32],  # [shape_count] sum over the shape's cubics, before weight
):
    """Bending of each cubic: (|a|^2 + |b|^2) / (1 + c), a and b the second differences of its control points
    and c the distance of its ends. A unit of length, as a hundredth of the outline of a circle is; but large
    where handles are long for the way that they go, as in burrs and loops. One thread a shape.
    """
    shape = offset + wp.tid()
    total = float(0.0)
    for cubic in range(cubic_first[shape + 1] - cubic_first[shape]):
        i0 = point_first[shape] + 3 * cubic
        i3 = cubic_end(i0, point_first, shape)
        p0 = points[i0]
        p1 = points[i0 + 1]
        p2 = points[i0 + 2]
        p3 = points[i3]
        a = p0 - 2.0 * p1 + p2
        b = p1 - 2.0 * p2 + p3
        chord = p3 - p0
        c = wp.length(chord)
        squares = wp.dot(a, a) + wp.dot(b, b)
        energy = squares / (1.0 + c)
        total += energy
        k = 2.0 * weight / (1.0 + c)
        stretch = wp.vec2(0.0, 0.0)
        if c > EPSILON:
            stretch = (weight * energy / ((1.0 + c) * c)) * chord
        points_grad[i0] = points_grad[i0] + k * a + stretch
        points_grad[i0 + 1] = points_grad[i0 + 1] + k * (b - 2.0 * a)
        points_grad[i0 + 2] = points_grad[i0 + 2] + k * (a - 2.0 * b)
        points_grad[i3] = points_grad[i3] + k * b - stretch
    shape_loss[shape] = total
