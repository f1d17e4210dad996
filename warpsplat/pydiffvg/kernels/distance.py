"""Positions -> the nearest point of the curves of a scene, and on which side of its group's outline they are.

A curve is q(t): a line, a cubic Bézier or an ellipse. Where (q - p) . q' goes from negative to positive the
distance from p has a minimum; it is bracketed in equal pieces of t and found by false position. There the
distance depends on the curve by way of q alone, t being constant, so that no kernel needs an adjoint
(``warpsplat.pydiffvg.distance``).
"""

from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.elementary import sine_and_cosine

wp.set_module_options(constants.MODULE_OPTIONS)

LINE = 0
CUBIC = 1
ELLIPSE = 2
"""Kinds of curves."""

NOT_FILLED = -1
"""Rule of a group without a fill."""

PIECES = wp.constant(16)  # of a curve, of which each has at most one minimum of the distance
STEPS = wp.constant(14)  # of false position
BISECTIONS = wp.constant(26)  # that find where a curve crosses a height
FULL_TURN = wp.constant(6.2831853)
TINY = wp.constant(1.0e-20)
FAR = wp.constant(1.0e30)

curve: Any = wp.types.matrix(shape=(2, 4), dtype=wp.float32)
"""Control points, as columns; of a line its ends are the first and last. Of an ellipse the centre and two
conjugate radii, which are directions. [canvas units]
"""


@wp.func
def relative(controls: wp.array2d[wp.vec2], j: wp.int32, kind: wp.int32, p: wp.vec2) -> curve:
    """Return curve ``j``, with ``p`` as the origin."""
    found = curve()
    for i in range(4):
        at = controls[j, i]
        if kind != ELLIPSE or i == 0:
            at -= p
        found[0, i] = at[0]
        found[1, i] = at[1]
    return found


@wp.func
def curve_point(c: curve, kind: wp.int32, t: wp.float32) -> wp.vec2:
    """Return q(t)."""
    if kind == ELLIPSE:
        turn = sine_and_cosine(FULL_TURN * t)
        return c * wp.vec4(1.0, turn[1], turn[0], 0.0)
    r = 1.0 - t
    return c * wp.vec4(r * r * r, 3.0 * r * r * t, 3.0 * r * t * t, t * t * t)


@wp.func
def curve_slope(c: curve, kind: wp.int32, t: wp.float32) -> wp.vec2:
    """Return q'(t)."""
    if kind == ELLIPSE:
        turn = sine_and_cosine(FULL_TURN * t)
        return FULL_TURN * (c * wp.vec4(0.0, -turn[0], turn[1], 0.0))
    r = 1.0 - t
    return 3.0 * (c * wp.vec4(-r * r, r * (r - 2.0 * t), t * (2.0 * r - t), t * t))


@wp.func
def minimum(c: curve, kind: wp.int32, start: wp.float32, end: wp.float32) -> wp.float32:
    """Return where the square of q, which falls at ``start`` and rises at ``end``, is least."""
    low = start
    high = end
    f_low = wp.dot(curve_point(c, kind, low), curve_slope(c, kind, low))
    f_high = wp.dot(curve_point(c, kind, high), curve_slope(c, kind, high))
    t = 0.5 * (low + high)
    for _ in range(STEPS):
        f = wp.dot(curve_point(c, kind, t), curve_slope(c, kind, t))
        # The end that stays counts half, or it might stay for ever.
        if f < 0.0:
            low = t
            f_low = f
            f_high *= 0.5
        else:
            high = t
            f_high = f
            f_low *= 0.5
        t = 0.5 * (low + high)
        if f_high > f_low:
            t = wp.clamp((low * f_high - high * f_low) / (f_high - f_low), low, high)
    return t


@wp.func
def nearest_to_origin(c: curve, kind: wp.int32, least: wp.float32) -> wp.vec2:
    """Return the parameter of the point nearest to the origin and the square of its distance, if that is
    below ``least``, else ``least``.
    """
    best = wp.vec2(0.0, least)
    if kind == LINE:
        a = wp.vec2(c[0, 0], c[1, 0])
        e = wp.vec2(c[0, 3], c[1, 3]) - a
        t = wp.clamp(-wp.dot(a, e) / wp.max(wp.dot(e, e), TINY), 0.0, 1.0)
        q = a + t * e
        if wp.dot(q, q) < least:
            best = wp.vec2(t, wp.dot(q, q))
        return best
    q = curve_point(c, kind, 0.0)
    rises = wp.dot(q, curve_slope(c, kind, 0.0)) >= 0.0
    if wp.dot(q, q) < best[1]:
        best = wp.vec2(0.0, wp.dot(q, q))
    for k in range(1, PIECES + 1):
        t = float(k) / float(PIECES)
        q = curve_point(c, kind, t)
        fell = not rises
        rises = wp.dot(q, curve_slope(c, kind, t)) >= 0.0
        if fell and rises:
            t = minimum(c, kind, t - 1.0 / float(PIECES), t)
            q = curve_point(c, kind, t)
        if wp.dot(q, q) < best[1]:
            best = wp.vec2(t, wp.dot(q, q))
    return best


@wp.func
def distance_of_box(c: curve, kind: wp.int32) -> wp.float32:
    """Return the square of the distance of the origin from a box around a curve."""
    low = wp.vec2(0.0, 0.0)
    high = wp.vec2(0.0, 0.0)
    for axis in range(2):
        if kind == ELLIPSE:
            reach = wp.abs(c[axis, 1]) + wp.abs(c[axis, 2])
            low[axis] = c[axis, 0] - reach
            high[axis] = c[axis, 0] + reach
        else:
            low[axis] = wp.min(wp.min(c[axis, 0], c[axis, 1]), wp.min(c[axis, 2], c[axis, 3]))
            high[axis] = wp.max(wp.max(c[axis, 0], c[axis, 1]), wp.max(c[axis, 2], c[axis, 3]))
    x = wp.max(wp.max(low[0], -high[0]), 0.0)
    y = wp.max(wp.max(low[1], -high[1]), 0.0)
    return x * x + y * y


@wp.func
def winding_of_piece(
    c: curve, start: wp.float32, end: wp.float32, y0: wp.float32, y1: wp.float32
) -> wp.int32:
    """Return what a piece of a Bézier that goes from height ``y0`` to ``y1`` without turning back adds to the
    winding number of the origin.
    """
    if (y0 <= 0.0) == (y1 <= 0.0):
        return 0
    low = start
    high = end
    for _ in range(BISECTIONS):
        t = 0.5 * (low + high)
        if (curve_point(c, CUBIC, t)[1] <= 0.0) == (y0 <= 0.0):
            low = t
        else:
            high = t
    if curve_point(c, CUBIC, 0.5 * (low + high))[0] >= 0.0:
        return 0
    return wp.where(y1 > y0, 1, -1)


@wp.func
def winding_of(c: curve, kind: wp.int32) -> wp.int32:
    """Return what a curve adds to the winding number of the origin."""
    if kind == ELLIPSE:
        area = c[0, 1] * c[1, 2] - c[1, 1] * c[0, 2]
        u = c[0, 0] * c[1, 2] - c[1, 0] * c[0, 2]
        v = c[0, 1] * c[1, 0] - c[1, 1] * c[0, 0]
        return wp.where(u * u + v * v < area * area, 1, 0)
    # Where the height turns back: y' / 3 = a t^2 - 2 b t + d.
    d = c[1, 1] - c[1, 0]
    middle = c[1, 2] - c[1, 1]
    a = d - 2.0 * middle + c[1, 3] - c[1, 2]
    b = d - middle
    root = wp.sqrt(wp.max(b * b - a * d, 0.0))
    most = wp.where(b >= 0.0, b + root, b - root)
    t0 = float(0.0)
    y0 = c[1, 0]
    first = wp.clamp(wp.where(wp.abs(most) > TINY, d / most, 0.0), 0.0, 1.0)
    second = wp.clamp(wp.where(wp.abs(a) > TINY, most / a, 1.0), 0.0, 1.0)
    found = int(0)
    for k in range(3):
        t1 = wp.where(k == 0, wp.min(first, second), wp.where(k == 1, wp.max(first, second), 1.0))
        y1 = c[1, 3]
        if t1 < 1.0:
            y1 = curve_point(c, CUBIC, t1)[1]
        found += winding_of_piece(c, t0, t1, y0, y1)
        t0 = t1
        y0 = y1
    return found


@wp.kernel
def nearest_points(
    # In:
    offset: wp.int32,
    positions: wp.array[wp.vec2],  # [position_count] canvas units
    controls: wp.array2d[wp.vec2],  # [curve_count, 4] canvas units; see ``curve``
    kind: wp.array[wp.int32],  # [curve_count] LINE, CUBIC or ELLIPSE
    is_drawn: wp.array[wp.int32],  # [curve_count] 0: only closes an open path, for its fill
    group_first: wp.array[wp.int32],  # [group_count + 1] first curve of each group
    rule: wp.array[wp.int32],  # [group_count] NONZERO, EVENODD or NOT_FILLED
    # Out:
    nearest: wp.array[wp.int32],  # [position_count] nearest curve; NONE: there is none
    parameter: wp.array[wp.float32],  # [position_count] of its nearest point; of a turn for ellipses
    sign: wp.array[wp.float32],  # [position_count] -1 inside of the nearest curve's group, if filled; else 1
):
    """Find the nearest curve; of those equally near one of the front group. One thread a position."""
    i = offset + wp.tid()
    p = positions[i]
    best = wp.vec2(0.0, FAR)
    found = int(constants.NONE)
    found_group = int(0)
    for g in range(rule.shape[0]):
        group = rule.shape[0] - 1 - g
        for j in range(group_first[group], group_first[group + 1]):
            if is_drawn[j] != 0:
                c = relative(controls, j, kind[j], p)
                if distance_of_box(c, kind[j]) < best[1]:
                    near = nearest_to_origin(c, kind[j], best[1])
                    if near[1] < best[1]:
                        best = near
                        found = j
                        found_group = group
    side = float(1.0)
    if found != constants.NONE:
        if rule[found_group] != NOT_FILLED:
            winding = int(0)
            for j in range(group_first[found_group], group_first[found_group + 1]):
                winding += winding_of(relative(controls, j, kind[j], p), kind[j])
            if winding % 2 != 0 or (winding != 0 and rule[found_group] == constants.NONZERO):
                side = -1.0
    nearest[i] = found
    parameter[i] = best[0]
    sign[i] = side
