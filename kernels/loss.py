"""L2 and Xing losses with their gradients."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cross
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

EPSILON = wp.constant(constants.EPSILON)


@wp.kernel
def l2_loss(
    # In:
    first: wp.int32,
    lane_columns: wp.int32,
    image: wp.array3d[column],  # [tile_count, 3, TILE]
    target: wp.array3d[column],  # [tile_count, 3, TILE]
    inside: wp.array2d[column],  # [tile_count, TILE] 1 for pixels of the image
    value_count: wp.int32,  # pixels x channels
    # Out:
    image_grad: wp.array3d[column],  # [tile_count, 3, TILE]
    loss: wp.array2d[wp.float32],  # [tile_count, lanes] sums of squares
):
    """Mean squared error over pixels and channels (paper eq. 12, first term) and its gradient."""
    i, lane = wp.tid()
    tile = first + i
    factor = 2.0 / float(value_count)
    squares = column(0.0)
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        for channel in range(3):
            difference = wp.cw_mul(inside[tile, x], image[tile, channel, x] - target[tile, channel, x])
            image_grad[tile, channel, x] = factor * difference
            squares = squares + wp.cw_mul(difference, difference)
    loss[tile, lane] = total(squares)


@wp.func
def sine(a: wp.vec2, b: wp.vec2) -> wp.float32:
    """Sine of the angle from ``a`` to ``b``; 0 where either has no length."""
    return cross(a, b) / wp.max(wp.length(a) * wp.length(b), EPSILON)


@wp.kernel
def xing_backward(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    closed: wp.int32,
    weight: wp.float32,
    # Out:
    points_grad: wp.array2d[wp.vec2],  # [curve_count, point_count] added to
    curve_loss: wp.array[wp.float32],  # [curve_count] sum over the curve's segments, before weight and mean
):
    """Xing loss of LIVE (Ma et al. 2022, eq. 5) of each cubic's control polygon edges v1, v2, v3:
    relu(-sin(v1, v3)) where sin(v1, v2) >= 0, else relu(sin(v1, v3)); the mean over all segments.

    One thread a curve. d sin(a, b) / da = (perp(b) - sin a |b| / |a|) / (|a| |b|), perp(b) = (b_y, -b_x).
    """
    curve = first + wp.tid()
    point_count = points.shape[1]
    segment_count = point_count / 3
    factor = weight / float(points.shape[0] * segment_count)
    total = float(0.0)
    for segment in range(segment_count):
        i0 = 3 * segment
        i3 = i0 + 3
        if closed == 1:
            i3 = i3 % point_count
        a = points[curve, i0 + 1] - points[curve, i0]
        middle = points[curve, i0 + 2] - points[curve, i0 + 1]
        b = points[curve, i3] - points[curve, i0 + 2]
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
            points_grad[curve, i0] = points_grad[curve, i0] - a_grad
            points_grad[curve, i0 + 1] = points_grad[curve, i0 + 1] + a_grad
            points_grad[curve, i0 + 2] = points_grad[curve, i0 + 2] - b_grad
            points_grad[curve, i3] = points_grad[curve, i3] + b_grad
    curve_loss[curve] = total


@wp.kernel
def bending_backward(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    closed: wp.int32,
    weight: wp.float32,
    # Out:
    points_grad: wp.array2d[wp.vec2],  # [curve_count, point_count] added to
    curve_loss: wp.array[wp.float32],  # [curve_count] sum over the curve's cubics, before weight
):
    """Bending of each cubic: (|a|^2 + |b|^2) / (1 + c), a and b the second differences of its control points
    and c the distance of its ends. A unit of length, as a hundredth of the outline of a circle is; but large
    where handles are long for the way that they go, as in burrs and loops. One thread a curve.
    """
    curve = first + wp.tid()
    point_count = points.shape[1]
    total = float(0.0)
    for segment in range(point_count / 3):
        i0 = 3 * segment
        i3 = i0 + 3
        if closed == 1:
            i3 = i3 % point_count
        p0 = points[curve, i0]
        p1 = points[curve, i0 + 1]
        p2 = points[curve, i0 + 2]
        p3 = points[curve, i3]
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
        points_grad[curve, i0] = points_grad[curve, i0] + k * a + stretch
        points_grad[curve, i0 + 1] = points_grad[curve, i0 + 1] + k * (b - 2.0 * a)
        points_grad[curve, i0 + 2] = points_grad[curve, i0 + 2] + k * (a - 2.0 * b)
        points_grad[curve, i3] = points_grad[curve, i3] + k * b - stretch
    curve_loss[curve] = total
