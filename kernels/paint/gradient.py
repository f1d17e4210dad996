"""Linear and radial gradients: the colours of a slot's pixels, and the adjoint (SVG 1.1, 13.2).

A frame maps the gradient's unit space to the canvas; a pixel's centre, mapped back, has the parameter t. On a
linear gradient that is its first coordinate; on a radial one it says which of the circles between the focus
and the unit circle goes through it: the larger root s of |p - c0 + s c0| = r0 + s (1 - r0). Between two stops
colours and opacities are interpolated, colours not premultiplied, at t after the spread.
``padded`` has faster kernels for the common cases, ramps and chains.
"""

from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

TINY = wp.constant(1.0e-12)

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
def is_ramp(
    spread: wp.int32, focus: wp.vec3, offsets: wp.array[wp.float32], first: wp.int32, last: wp.int32
) -> wp.bool:
    """Return whether a gradient is a ramp: padded, centred, with two ascending stops."""
    if spread != constants.PAD or last - first != 2:
        return False
    if focus[0] != 0.0 or focus[1] != 0.0 or focus[2] != 0.0:
        return False
    return offsets[first + 1] > offsets[first]


@wp.func
def is_chain(spread: wp.int32, focus: wp.vec3, first: wp.int32, last: wp.int32) -> wp.bool:
    """Return whether a gradient is a chain: padded, centred, with three stops or more in any order."""
    if spread != constants.PAD or last - first < 3:
        return False
    return focus[0] == 0.0 and focus[1] == 0.0 and focus[2] == 0.0


@wp.func
def is_columnwise(
    spread: wp.int32, focus: wp.vec3, offsets: wp.array[wp.float32], first: wp.int32, last: wp.int32
) -> wp.bool:
    """Return whether a gradient is a ramp or a chain."""
    if is_ramp(spread, focus, offsets, first, last):
        return True
    return is_chain(spread, focus, first, last)


@wp.func
def pixel_place(tile: wp.int32, tiles_x: wp.int32, x: wp.int32, y: wp.int32, scale: wp.float32) -> wp.vec2:
    """Return the centre of a tile's pixel, canvas units."""
    px = float(constants.TILE * (tile % tiles_x) + x) + 0.5
    py = float(constants.TILE * (tile / tiles_x) + y) + 0.5
    return wp.vec2(px / scale, py / scale)


@wp.kernel
def gradient_forward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tiles_x: wp.int32,
    scale: wp.float32,
    slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    paint: wp.array[wp.int32],  # [shape_count]
    spread: wp.array[wp.int32],  # [shape_count]
    frames: wp.array[frame],  # [shape_count]
    focus: wp.array[wp.vec3],  # [shape_count]
    stop_first: wp.array[wp.int32],  # [shape_count + 1]
    stop_offsets: wp.array[wp.float32],  # [stop_count]
    stop_colors: wp.array[wp.vec3],  # [stop_count]
    stop_opacities: wp.array[wp.float32],  # [stop_count]
    # Out:
    paint_pixels: wp.array3d[wp.float32],  # [paint_slots, 4, TILE_PIXELS] colour and opacity, by column
):
    """Colour the pixels of visible slots of gradients that go pixel by pixel. One thread a slot and lane."""
    i, lane = wp.tid()
    slot = offset + i
    shape = slot_shape[slot]
    if shape < 0:
        return
    state = slot_state[slot]
    if not is_gradient(paint[shape]) or state & constants.COVERED == 0 or state & constants.HIDDEN != 0:
        return
    if is_columnwise(spread[shape], focus[shape], stop_offsets, stop_first[shape], stop_first[shape + 1]):
        return
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        for y in range(constants.TILE):
            place = to_unit(frames[shape], pixel_place(slot_tile[slot], tiles_x, x, y, scale))
            raw = parameter(paint[shape], focus[shape], place)
            t = spread_out(spread[shape], raw[0])
            at = between_stops(stop_offsets, stop_first[shape], stop_first[shape + 1], t[0])
            color = (1.0 - at.share) * stop_colors[at.low] + at.share * stop_colors[at.high]
            p = constants.TILE * x + y
            paint_pixels[slot, 0, p] = color[0]
            paint_pixels[slot, 1, p] = color[1]
            paint_pixels[slot, 2, p] = color[2]
            low = stop_opacities[at.low]
            paint_pixels[slot, 3, p] = low + at.share * (stop_opacities[at.high] - low)


@wp.kernel
def gradient_backward(
    # In:
    offset: wp.int32,
    tiles_x: wp.int32,
    scale: wp.float32,
    slot_first: wp.array[wp.int32],  # [shape_count]
    slot_last: wp.array[wp.int32],  # [shape_count]
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    paint: wp.array[wp.int32],  # [shape_count]
    spread: wp.array[wp.int32],  # [shape_count]
    frames: wp.array[frame],  # [shape_count]
    focus: wp.array[wp.vec3],  # [shape_count]
    stop_first: wp.array[wp.int32],  # [shape_count + 1]
    stop_offsets: wp.array[wp.float32],  # [stop_count]
    stop_colors: wp.array[wp.vec3],  # [stop_count]
    stop_opacities: wp.array[wp.float32],  # [stop_count]
    paint_pixels: wp.array3d[wp.float32],  # [paint_slots, 4, TILE_PIXELS] gradients of colour and opacity
    # Out:
    frames_grad: wp.array[frame],  # [shape_count] written
    stop_offsets_grad: wp.array[wp.float32],  # [stop_count] written
    stop_colors_grad: wp.array[wp.vec3],  # [stop_count] written
    stop_opacities_grad: wp.array[wp.float32],  # [stop_count] written
):
    """Sum over a shape's visible slots in a fixed order: the same bits on every run. The focus is treated as
    a constant. One thread a shape.
    """
    shape = offset + wp.tid()
    if not is_gradient(paint[shape]):
        return
    first = stop_first[shape]
    last = stop_first[shape + 1]
    if is_columnwise(spread[shape], focus[shape], stop_offsets, first, last):
        return
    for i in range(first, last):
        stop_offsets_grad[i] = 0.0
        stop_colors_grad[i] = wp.vec3(0.0, 0.0, 0.0)
        stop_opacities_grad[i] = 0.0
    f = frames[shape]
    origin = wp.vec2(0.0, 0.0)
    along = wp.vec2(0.0, 0.0)
    across = wp.vec2(0.0, 0.0)
    for slot in range(slot_first[shape], slot_last[shape]):
        state = slot_state[slot]
        if state & constants.COVERED != 0 and state & constants.HIDDEN == 0:
            for p in range(constants.TILE * constants.TILE):
                g = wp.vec3(paint_pixels[slot, 0, p], paint_pixels[slot, 1, p], paint_pixels[slot, 2, p])
                g_opacity = paint_pixels[slot, 3, p]
                place = to_unit(
                    f, pixel_place(slot_tile[slot], tiles_x, p / constants.TILE, p % constants.TILE, scale)
                )
                raw = parameter(paint[shape], focus[shape], place)
                t = spread_out(spread[shape], raw[0])
                at = between_stops(stop_offsets, first, last, t[0])
                low_share = 1.0 - at.share
                stop_colors_grad[at.low] = stop_colors_grad[at.low] + low_share * g
                stop_colors_grad[at.high] = stop_colors_grad[at.high] + at.share * g
                stop_opacities_grad[at.low] = stop_opacities_grad[at.low] + low_share * g_opacity
                stop_opacities_grad[at.high] = stop_opacities_grad[at.high] + at.share * g_opacity
                if at.width > 0.0:
                    step = wp.dot(g, stop_colors[at.high] - stop_colors[at.low])
                    step += g_opacity * (stop_opacities[at.high] - stop_opacities[at.low])
                    by_t = step / at.width
                    if at.low_is_own == 1:
                        stop_offsets_grad[at.low] = stop_offsets_grad[at.low] - low_share * by_t
                    if at.high_is_own == 1:
                        stop_offsets_grad[at.high] = stop_offsets_grad[at.high] - at.share * by_t
                    move = (-by_t * t[1]) * to_unit_adjoint(f, wp.vec2(raw[1], raw[2]))
                    origin += move
                    along += place[0] * move
                    across += place[1] * move
    frames_grad[shape] = frame(origin[0], origin[1], along[0], along[1], across[0], across[1])
