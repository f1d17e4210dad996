"""L2 and Xing losses with their gradients."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cross

wp.set_module_options({"enable_backward": False})

EPSILON = wp.constant(constants.EPSILON)


@wp.kernel
def l2_loss(
    # In:
    first: wp.int32,
    image: wp.array2d[wp.vec3],  # [height, width]
    target: wp.array2d[wp.vec3],  # [height, width]
    # Out:
    image_grad: wp.array2d[wp.vec3],  # [height, width]
    row_loss: wp.array[wp.float32],  # [height] sums of squares
):
    """Mean squared error over pixels and channels (paper eq. 12, first term) and its gradient."""
    y = first + wp.tid()
    factor = 2.0 / (3.0 * float(image.shape[0]) * float(image.shape[1]))
    total = float(0.0)
    for x in range(image.shape[1]):
        difference = image[y, x] - target[y, x]
        image_grad[y, x] = factor * difference
        total += wp.dot(difference, difference)
    row_loss[y] = total


@wp.kernel
def sum_rows(
    # In:
    first: wp.int32,
    row_loss: wp.array[wp.float32],  # [height]
    width: wp.int32,
    # Out:
    loss: wp.array[wp.float32],  # [1] mean squared error
):
    """One thread; float64, so that the figure does not depend on the order of magnitude of the rows."""
    total = wp.float64(0.0)
    for y in range(row_loss.shape[0]):
        total += wp.float64(row_loss[y])
    loss[first + wp.tid()] = float(total / wp.float64(3 * width * row_loss.shape[0]))


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
