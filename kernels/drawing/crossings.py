"""Where contours cross themselves."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.drawing.cubic import point_at, polynomial

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def side(a: wp.vec2d, b: wp.vec2d, p: wp.vec2d) -> wp.float64:
    """Return twice the signed area of a triangle: its sign tells on which side of the line p lies."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


@wp.func
def meet(a: wp.vec2d, b: wp.vec2d, c: wp.vec2d, d: wp.vec2d) -> wp.bool:
    """Return whether the lines from a to b and from c to d cross; to touch is not to cross."""
    if wp.max(a[0], b[0]) < wp.min(c[0], d[0]) or wp.max(c[0], d[0]) < wp.min(a[0], b[0]):
        return False
    if wp.max(a[1], b[1]) < wp.min(c[1], d[1]) or wp.max(c[1], d[1]) < wp.min(a[1], b[1]):
        return False
    return side(a, b, c) * side(a, b, d) < wp.float64(0.0) and side(c, d, a) * side(c, d, b) < wp.float64(0.0)


@wp.kernel
def flatten(
    # In:
    offset: wp.int32,
    cubics: wp.array[wp.vec2d],  # [4 x cubic]
    # Out:
    points: wp.array2d[wp.vec2d],  # [cubic, point] from end to end
    low: wp.array[wp.vec2d],  # [cubic] corners of their boxes
    high: wp.array[wp.vec2d],  # [cubic]
):
    """Make polylines of cubics. One thread a cubic."""
    i = offset + wp.tid()
    f = polynomial(cubics, i)
    last = points.shape[1] - 1
    lower = cubics[4 * i]
    upper = lower
    for n in range(last + 1):
        p = point_at(f, wp.float64(n) / wp.float64(last))
        if n == last:
            p = cubics[4 * i + 3]
        points[i, n] = p
        lower = wp.min(lower, p)
        upper = wp.max(upper, p)
    low[i] = lower
    high[i] = upper


@wp.kernel
def crossings(
    # In:
    offset: wp.int32,
    order: wp.array[wp.int64],  # [n] cubics by contour and then by their left ends
    end: wp.array[wp.int64],  # [n] where in ``order`` the contour of each ends
    points: wp.array2d[wp.vec2d],  # [cubic, point] as ``flatten`` gives them
    low: wp.array[wp.vec2d],  # [cubic]
    high: wp.array[wp.vec2d],  # [cubic]
    following: wp.array[wp.int64],  # [cubic]
    # Out:
    found: wp.array[wp.int32],  # [cubic] updated: by how many cubics it is crossed
):
    """Find cubics that cross cubics of the same contour, or themselves. One thread a cubic."""
    k = offset + wp.tid()
    i = int(order[k])
    last = points.shape[1] - 2
    for other in range(k, int(end[k])):
        j = int(order[other])
        if low[j][0] >= high[i][0]:
            break
        if low[j][1] < high[i][1] and high[j][1] > low[i][1]:
            after = int(following[i]) == j
            before = int(following[j]) == i
            cross = bool(False)
            for m in range(last + 1):
                first = int(0)
                if i == j:
                    first = m + 2
                for n in range(first, last + 1):
                    # The joint of two cubics is no crossing.
                    joint = (after and m == last and n == 0) or (before and n == last and m == 0)
                    if not cross and not joint:
                        cross = meet(points[i, m], points[i, m + 1], points[j, n], points[j, n + 1])
            if cross:
                wp.atomic_add(found, i, 1)
                wp.atomic_add(found, j, 1)
