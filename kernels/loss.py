"""Losses with their gradients: L2 and SSIM of the image, Xing and bending of the curves."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cross
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
EPSILON = wp.constant(constants.EPSILON)
WINDOW = wp.constant(8)
C1 = wp.constant(0.01 * 0.01)
C2 = wp.constant(0.03 * 0.03)


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


@wp.kernel
def ssim_backward(
    # In:
    first: wp.int32,
    image: wp.array3d[column],  # [tile_count, 3, TILE]
    target: wp.array3d[column],  # [tile_count, 3, TILE]
    inside: wp.array2d[column],  # [tile_count, TILE] 1 for pixels of the image
    clock: wp.array[wp.int32],  # [1] steps so far
    weight: wp.float32,
    value_count: wp.int32,  # pixels x channels
    # Out:
    image_grad: wp.array3d[column],  # [tile_count, 3, TILE] added to
    similarity: wp.array2d[wp.float32],  # [tile_count, 3] sum over windows of SSIM x pixels
):
    """``weight`` x (1 - SSIM) (Wang et al. 2004, eq. 13) with windows of 8x8 px that do not overlap.

    Within such a window the gradient is a + b x + c y, x and y the pixel's values: a window costs no more
    than its sums. The windows lie inside a tile and move by half their size from step to step, cut where the
    tile ends, so that no grid is left in the image. One thread a tile and channel.
    """
    i, channel = wp.tid()
    tile = first + i
    phase = clock[0] % 4
    shift_x = (phase % 2) * (WINDOW / 2)
    shift_y = (phase / 2) * (WINDOW / 2)
    factor = weight / float(value_count)
    sum_all = float(0.0)
    x0 = int(0)
    while x0 < TILE:
        x1 = wp.min((x0 + shift_x) / WINDOW * WINDOW + WINDOW - shift_x, TILE)
        n = column(0.0)
        sx = column(0.0)
        sy = column(0.0)
        sxx = column(0.0)
        syy = column(0.0)
        sxy = column(0.0)
        for x in range(x0, x1):
            mask = inside[tile, x]
            u = wp.cw_mul(mask, image[tile, channel, x])
            v = wp.cw_mul(mask, target[tile, channel, x])
            n = n + mask
            sx = sx + u
            sy = sy + v
            sxx = sxx + wp.cw_mul(u, u)
            syy = syy + wp.cw_mul(v, v)
            sxy = sxy + wp.cw_mul(u, v)
        a = column(0.0)
        b = column(0.0)
        c = column(0.0)
        y0 = int(0)
        while y0 < TILE:
            y1 = wp.min((y0 + shift_y) / WINDOW * WINDOW + WINDOW - shift_y, TILE)
            count = float(0.0)
            mx = float(0.0)
            my = float(0.0)
            xx = float(0.0)
            yy = float(0.0)
            xy = float(0.0)
            for y in range(y0, y1):
                count += n[y]
                mx += sx[y]
                my += sy[y]
                xx += sxx[y]
                yy += syy[y]
                xy += sxy[y]
            if count > 0.0:
                mx /= count
                my /= count
                a1 = 2.0 * mx * my + C1
                a2 = 2.0 * (xy / count - mx * my) + C2
                b1 = mx * mx + my * my + C1
                b2 = xx / count - mx * mx + yy / count - my * my + C2
                s = a1 * a2 / (b1 * b2)
                sum_all += s * count
                slope_x = -2.0 * s / b2
                slope_y = 2.0 * a1 / (b1 * b2)
                offset = 2.0 * (my * a2 / b2 - mx * s) / b1 - slope_x * mx - slope_y * my
                for y in range(y0, y1):
                    a[y] = factor * offset
                    b[y] = factor * slope_x
                    c[y] = factor * slope_y
            y0 = y1
        for x in range(x0, x1):
            gradient = a + wp.cw_mul(b, image[tile, channel, x]) + wp.cw_mul(c, target[tile, channel, x])
            gradient = wp.cw_mul(inside[tile, x], gradient)
            image_grad[tile, channel, x] = image_grad[tile, channel, x] - gradient
        x0 = x1
    similarity[tile, channel] = sum_all


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
