"""Normal equations of outlines, and their solution by conjugate gradients, a contour at a time.

The **numbers** of a contour are the coordinates of its points, or the free numbers that take their places:
those of cubic ``i`` are ``6 i`` to ``6 i + 5``. The matrix from free numbers to coordinates is sparse:
``row``, ``column``, ``value``, sorted by contour.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.drawing.cubic import point_at, polynomial

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def bernstein(k: wp.int32, t: wp.float64) -> wp.float64:
    """Return the weight of control point ``k`` at ``t``."""
    s = wp.float64(1.0) - t
    if k == 0:
        return s * s * s
    if k == 1:
        return wp.float64(3.0) * s * s * t
    if k == 2:
        return wp.float64(3.0) * s * t * t
    return t * t * t


@wp.kernel
def derivatives(
    # In:
    offset: wp.int32,
    cubics: wp.array[wp.vec2d],  # [4 x cubic] [px]
    first: wp.array[wp.int64],  # [cubic + 1]
    t: wp.array[wp.float64],  # [sample]
    place: wp.array[wp.vec2d],  # [sample] [px]
    across: wp.array[wp.vec2d],  # [sample]
    weight: wp.array[wp.float64],  # [sample]
    # Out:
    gradient: wp.array2d[wp.float64],  # [cubic, 8] updated
    blocks: wp.array2d[wp.float64],  # [cubic, 30] updated: xx, xy, yy for each pair of control points
):
    """Sum the derivatives of the samples' errors by the control points. One thread a cubic."""
    i = offset + wp.tid()
    f = polynomial(cubics, i)
    for s in range(int(first[i]), int(first[i + 1])):
        w = wp.float64(2.0) * weight[s]
        u = across[s]
        force = w * wp.dot(point_at(f, t[s]) - place[s], u)
        n = int(0)
        for j in range(4):
            share = bernstein(j, t[s])
            gradient[i, 2 * j] = gradient[i, 2 * j] + share * force * u[0]
            gradient[i, 2 * j + 1] = gradient[i, 2 * j + 1] + share * force * u[1]
            for k in range(j, 4):
                both = share * bernstein(k, t[s]) * w
                blocks[i, n] = blocks[i, n] + both * u[0] * u[0]
                blocks[i, n + 1] = blocks[i, n + 1] + both * u[0] * u[1]
                blocks[i, n + 2] = blocks[i, n + 2] + both * u[1] * u[1]
                n += 3


@wp.func
def pair(j: wp.int32, k: wp.int32) -> wp.int32:
    """Return where the block of control points ``j`` and ``k`` begins."""
    a = wp.min(j, k)
    return 3 * (4 * a - a * (a - 1) / 2 + wp.abs(j - k))


@wp.func
def corner(i: wp.int32, k: wp.int32, following: wp.array[wp.int64]) -> wp.int32:
    """Return the first number of control point ``k`` of a cubic: the last one is the next cubic's first."""
    if k == 3:
        return 6 * int(following[i])
    return 6 * i + 2 * k


@wp.func
def push(
    begin: wp.int32,
    end: wp.int32,
    following: wp.array[wp.int64],
    blocks: wp.array2d[wp.float64],
    moved: wp.array[wp.float64],
    force: wp.array[wp.float64],  # [6 x cubic]
):
    """Set ``force`` to the change of the gradient when the coordinates of some cubics are ``moved``."""
    for n in range(6 * begin, 6 * end):
        force[n] = wp.float64(0.0)
    for i in range(begin, end):
        for j in range(4):
            x = wp.float64(0.0)
            y = wp.float64(0.0)
            for k in range(4):
                n = corner(i, k, following)
                b = pair(j, k)
                x += blocks[i, b] * moved[n] + blocks[i, b + 1] * moved[n + 1]
                y += blocks[i, b + 1] * moved[n] + blocks[i, b + 2] * moved[n + 1]
            n = corner(i, j, following)
            force[n] = force[n] + x
            force[n + 1] = force[n + 1] + y


@wp.kernel
def solve(
    # In:
    offset: wp.int32,
    contour_first: wp.array[wp.int64],  # [contour + 1] its cubics
    entry_first: wp.array[wp.int64],  # [contour + 1] its part of the matrix
    row: wp.array[wp.int64],  # [entry] coordinate
    column: wp.array[wp.int64],  # [entry] free number
    value: wp.array[wp.float64],  # [entry]
    following: wp.array[wp.int64],  # [cubic]
    blocks: wp.array2d[wp.float64],  # [cubic, 30] as ``derivatives`` gives them
    gradient: wp.array[wp.float64],  # [6 x cubic] by the coordinates
    damping: wp.array[wp.float64],  # [cubic] added curvature, as a share
    least: wp.float64,  # added curvature
    iterations: wp.int32,  # at most
    converged: wp.float64,  # square of the residual, over the first, at which they end
    # Out:
    moved: wp.array[wp.float64],  # [6 x cubic] zeros, as the others, and scratch
    force: wp.array[wp.float64],  # [6 x cubic]
    residual: wp.array[wp.float64],  # [6 x cubic]
    way: wp.array[wp.float64],  # [6 x cubic]
    pushed: wp.array[wp.float64],  # [6 x cubic]
    diagonal: wp.array[wp.float64],  # [6 x cubic]
    added: wp.array[wp.float64],  # [6 x cubic]
    found: wp.array[wp.float64],  # [6 x cubic] change of the free numbers
):
    """Find the free numbers that lower the error most, with damping. One thread a contour.

    An outline that slides along itself costs nothing, but leads away: damping is the same in all directions.
    """
    contour = offset + wp.tid()
    begin = int(contour_first[contour])
    end = int(contour_first[contour + 1])
    e0 = int(entry_first[contour])
    e1 = int(entry_first[contour + 1])
    for i in range(begin, end):
        for k in range(4):
            n = corner(i, k, following)
            b = pair(k, k)
            both = damping[i] * (blocks[i, b] + blocks[i, b + 2])
            moved[n] = moved[n] + blocks[i, b]
            moved[n + 1] = moved[n + 1] + blocks[i, b + 2]
            force[n] = force[n] + both
            force[n + 1] = force[n + 1] + both
    for e in range(e0, e1):
        r = int(row[e])
        c = int(column[e])
        v = value[e]
        diagonal[c] = diagonal[c] + v * v * moved[r]
        added[c] = added[c] + v * v * force[r]
        residual[c] = residual[c] - v * gradient[r]
    size = wp.float64(0.0)
    for n in range(6 * begin, 6 * end):
        added[n] = added[n] + least
        diagonal[n] = diagonal[n] + added[n]
        scaled = residual[n] / diagonal[n]
        way[n] = scaled
        size += residual[n] * scaled
    start = size
    done = int(0)
    while done < iterations and size > converged * start:
        for n in range(6 * begin, 6 * end):
            moved[n] = wp.float64(0.0)
            pushed[n] = added[n] * way[n]
        for e in range(e0, e1):
            r = int(row[e])
            moved[r] = moved[r] + value[e] * way[int(column[e])]
        push(begin, end, following, blocks, moved, force)
        for e in range(e0, e1):
            c = int(column[e])
            pushed[c] = pushed[c] + value[e] * force[int(row[e])]
        length = wp.float64(0.0)
        for n in range(6 * begin, 6 * end):
            length += way[n] * pushed[n]
        length = size / length
        after = wp.float64(0.0)
        for n in range(6 * begin, 6 * end):
            found[n] = found[n] + length * way[n]
            residual[n] = residual[n] - length * pushed[n]
            after += residual[n] * residual[n] / diagonal[n]
        for n in range(6 * begin, 6 * end):
            way[n] = residual[n] / diagonal[n] + after / size * way[n]
        size = after
        done += 1
