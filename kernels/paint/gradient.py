"""Linear and radial gradients: the colours of a slot's pixels, and the adjoint (SVG 1.1, 13.2).

A frame maps the gradient's unit space to the canvas; a pixel's centre, mapped back, has the parameter t. On a
linear gradient that is its first coordinate; on a radial one it says which of the circles between the focus
and the unit circle goes through it: the larger root s of |p - c0 + s c0| = r0 + s (1 - r0). Between two stops
colours and opacities are interpolated, colours not premultiplied, at t after the spread.
``gradient_forward`` are faster for the common cases, ramps and chains.
"""

from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

TINY = wp.constant(1.0e-12)
RAMP = wp.constant(0)
CHAIN = wp.constant(1)
GENERAL = wp.constant(2)

NAMES = {RAMP: "ramp", CHAIN: "chain", GENERAL: "gradient"}

frame: Any = wp.types.vector(length=6, dtype=wp.float32)
"""Origin, first axis, second axis."""


@wp.func
def is_gradient(paint: wp.int32) -> wp.bool:
    """Return whether a paint is a gradient."""
    if paint == constants.LINEAR:
        return True
    return paint == constants.RADIAL


@wp.func
def to_unit(f: frame, p: wp.vec2) -> wp.vec2:
    """Map a point of the canvas to the gradient's unit space; a frame without area has only the origin."""
    x = p[0] - f[0]
    y = p[1] - f[1]
    area = f[2] * f[5] - f[3] * f[4]
    if wp.abs(area) < TINY:
        return wp.vec2(0.0, 0.0)
    return wp.vec2((x * f[5] - y * f[4]) / area, (f[2] * y - f[3] * x) / area)


@wp.func
def to_unit_adjoint(f: frame, g: wp.vec2) -> wp.vec2:
    """Turn a derivative with respect to a point in unit space into one with respect to that on the canvas."""
    area = f[2] * f[5] - f[3] * f[4]
    if wp.abs(area) < TINY:
        return wp.vec2(0.0, 0.0)
    return wp.vec2((g[0] * f[5] - g[1] * f[3]) / area, (g[1] * f[2] - g[0] * f[4]) / area)


@wp.func
def parameter(paint: wp.int32, focus: wp.vec3, p: wp.vec2) -> wp.vec3:
    """Return t at a point of the unit space, and its derivatives by the two coordinates."""
    if paint == constants.LINEAR:
        return wp.vec3(p[0], 1.0, 0.0)
    c0 = wp.vec2(focus[0], focus[1])
    r0 = focus[2]
    d = p - c0
    a = wp.dot(c0, c0) - (1.0 - r0) * (1.0 - r0)
    b = r0 * (1.0 - r0) - wp.dot(d, c0)
    root = wp.sqrt(wp.max(b * b - a * (wp.dot(d, d) - r0 * r0), 0.0))
    if root < TINY or wp.abs(a) < TINY:
        return wp.vec3(0.0, 0.0, 0.0)
    s = (b - root) / a
    return wp.vec3(s, (s * c0[0] + d[0]) / root, (s * c0[1] + d[1]) / root)


@wp.func
def spread_out(spread: wp.int32, t: wp.float32) -> wp.vec2:
    """Return t mapped into [0, 1] by the spread, and the derivative of that; padded gradients keep t."""
    if spread == constants.PAD:
        return wp.vec2(t, 1.0)
    if spread == constants.REPEAT:
        return wp.vec2(t - wp.floor(t), 1.0)
    r = t - 2.0 * wp.floor(0.5 * t)
    if r > 1.0:
        return wp.vec2(2.0 - r, -1.0)
    return wp.vec2(r, 1.0)


@wp.struct
class Gradients:
    """Paints of all shapes; the stops of one are the rows from its ``stop_first`` to that of the next."""

    paint: wp.array[wp.int32]  # [shape_count]
    spread: wp.array[wp.int32]  # [shape_count]
    frames: wp.array[frame]  # [shape_count]
    focus: wp.array[wp.vec3]  # [shape_count]
    stop_first: wp.array[wp.int32]  # [shape_count + 1]
    stop_offsets: wp.array[wp.float32]  # [stop_count]
    stop_colors: wp.array[wp.vec3]  # [stop_count]
    stop_opacities: wp.array[wp.float32]  # [stop_count]


@wp.struct
class Between:
    """Position of t among the stops."""

    low: wp.int32
    high: wp.int32
    share: wp.float32  # of the higher one
    width: wp.float32  # between the two; 0 where only one counts
    low_is_own: wp.int32  # 1 where the lower one's offset is its own, not that of one before it
    high_is_own: wp.int32


@wp.func
def between_stops(offsets: wp.array[wp.float32], first: wp.int32, last: wp.int32, t: wp.float32) -> Between:
    """Return the two stops that ``t`` lies between; before the first and after the last, only that one
    counts.
    """
    result = Between()
    result.low = first
    result.high = first
    result.share = 0.0
    result.width = 0.0
    result.low_is_own = 1
    result.high_is_own = 1
    before = offsets[first]
    own_before = int(1)
    if t >= before:
        result.low = last - 1
        result.high = last - 1
        for i in range(first + 1, last):
            offset = offsets[i]
            own = int(1)
            if offset < before:
                offset = before
                own = int(0)
            if t < offset:
                result.low = i - 1
                result.high = i
                result.width = offset - before
                result.share = (t - before) / result.width
                result.low_is_own = own_before
                result.high_is_own = own
                return result
            before = offset
            own_before = own
    return result


@wp.func
def case_of(g: Gradients, shape: wp.int32) -> wp.int32:
    """Return which kernels draw a gradient: those of ramps (padded, centred, two ascending stops), of chains
    (padded, centred, three stops or more in any order), or the general ones.
    """
    if g.spread[shape] != constants.PAD or wp.length_sq(g.focus[shape]) != 0.0:
        return GENERAL
    first = g.stop_first[shape]
    last = g.stop_first[shape + 1]
    if last - first > 2:
        return CHAIN
    if last - first == 2:
        if g.stop_offsets[first + 1] > g.stop_offsets[first]:
            return RAMP
    return GENERAL


@wp.func
def pixel_place(tile: wp.int32, tiles_x: wp.int32, x: wp.int32, y: wp.int32, scale: wp.float32) -> wp.vec2:
    """Return the centre of a tile's pixel, canvas units."""
    px = float(constants.TILE * (tile % tiles_x) + x) + 0.5
    py = float(constants.TILE * (tile / tiles_x) + y) + 0.5
    return wp.vec2(px / scale, py / scale)
