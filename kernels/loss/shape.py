"""Losses of the shapes with their gradients: Xing and bending."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import Contour, add_bezier_grad, bezier_points, control_points, cross

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def sine(a: wp.vec2, b: wp.vec2) -> wp.float32:
    """Sine of the angle from ``a`` to ``b``; 0 where either has no length."""
    return cross(a, b) / wp.max(wp.length(a) * wp.length(b), constants.EPSILON)


@wp.func
def xing(p: control_points, weight: wp.float32):
    """Return the Xing loss of LIVE (Ma et al. 2022, eq. 5) of a Bézier's edges v1, v2, v3:
    relu(-sin(v1, v3)) where sin(v1, v2) >= 0, else relu(sin(v1, v3)); and ``weight`` x its gradient.

    d sin(a, b) / da = (perp(b) - sin a |b| / |a|) / (|a| |b|), perp(b) = (b_y, -b_x).
    """
    a = p[1] - p[0]
    middle = p[2] - p[1]
    b = p[3] - p[2]
    s = sine(a, b)
    sign = float(0.0)  # d loss / d s
    if cross(a, middle) >= 0.0:
        if s < 0.0:
            sign = -1.0
    elif s > 0.0:
        sign = 1.0
    length_a = wp.length(a)
    length_b = wp.length(b)
    product = length_a * length_b
    a_grad = wp.vec2(0.0, 0.0)
    b_grad = wp.vec2(0.0, 0.0)
    if sign != 0.0 and product > constants.EPSILON:
        k = weight * sign
        a_grad = k * (wp.vec2(b[1], -b[0]) / product - s * a / (length_a * length_a))
        b_grad = k * (wp.vec2(-a[1], a[0]) / product - s * b / (length_b * length_b))
    return sign * s, control_points(
        -a_grad[0], -a_grad[1], a_grad[0], a_grad[1], -b_grad[0], -b_grad[1], b_grad[0], b_grad[1]
    )


@wp.func
def bending(p: control_points, weight: wp.float32):
    """Return the bending of a Bézier, (|a|^2 + |b|^2) / (1 + c), a and b the second differences of its
    control points and c the distance of its ends; and ``weight`` x its gradient.

    A unit of length, as a hundredth of the outline of a circle is; but large where handles are long for the
    way that they go, as in burrs and loops.
    """
    a = p[0] - 2.0 * p[1] + p[2]
    b = p[1] - 2.0 * p[2] + p[3]
    chord = p[3] - p[0]
    c = wp.length(chord)
    energy = (wp.dot(a, a) + wp.dot(b, b)) / (1.0 + c)
    k = 2.0 * weight / (1.0 + c)
    stretch = wp.vec2(0.0, 0.0)
    if c > constants.EPSILON:
        stretch = (weight * energy / ((1.0 + c) * c)) * chord
    g0 = k * a + stretch
    g1 = k * (b - 2.0 * a)
    g2 = k * (a - 2.0 * b)
    g3 = k * b - stretch
    return energy, control_points(g0[0], g0[1], g1[0], g1[1], g2[0], g2[1], g3[0], g3[1])


def make_backward(name: str, loss: wp.Function, *, mean: bool) -> wp.Kernel:
    """Return the kernel of a loss of Béziers, as cubics; ``mean``: of all Béziers, or their sum."""

    @wp.kernel(name=name)
    def backward(
        # In:
        offset: wp.int32,
        points: wp.array[wp.vec2],  # [point_count] canvas units
        contours: wp.array[Contour],  # [contour_count]
        weight: wp.float32,
        # Out:
        points_grad: wp.array[wp.vec2],  # [point_count] added to
        contour_loss: wp.array[wp.float32],  # [contour_count] sum over its Béziers, before weight and mean
    ):
        """One thread a contour."""
        i = offset + wp.tid()
        contour = contours[i]
        factor = weight
        if mean:
            last = contours[contours.shape[0] - 1]
            factor = weight / float(last.bezier + last.beziers)
        total = float(0.0)
        for local in range(contour.beziers):
            value, grad = loss(bezier_points(points, contour, local), factor)
            total += value
            add_bezier_grad(grad, contour, local, points_grad)
        contour_loss[i] = total

    return backward


xing_backward = make_backward("xing_backward", xing, mean=True)
bending_backward = make_backward("bending_backward", bending, mean=False)
