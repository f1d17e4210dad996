"""Padded gradients of three stops or more, column by column: linear ones and those of a circle's centre.

What ``gradient`` computes of these, as vector arithmetic like ``ramp``. The colour at t is that of a stop and,
for each interval from there on, the clamped share of its second stop times the difference of the two: only
the intervals that a column reaches are looked at, which are one or two.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.gradient import (
    frame,
    is_chain,
    is_gradient,
    pixel_place,
    to_unit,
    to_unit_adjoint,
)
from warpsplat.kernels.paint.ramp import roots, rows, share_of_second
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

LINEAR = wp.constant(constants.LINEAR)
TILE = wp.constant(constants.TILE)
COVERED = wp.constant(constants.COVERED)
HIDDEN = wp.constant(constants.HIDDEN)
STEEP = wp.constant(1.0e9)  # makes a step of a clamped share
TINY = wp.constant(1.0e-12)


@wp.func
def interval_at(offsets: wp.array[wp.float32], start: wp.int32, last: wp.int32, t: wp.float32) -> wp.int32:
    """The first stop of the interval that ``t`` lies in, from ``start`` on; the end ones go on beyond it."""
    k = start
    while k < last - 2 and t >= offsets[k + 1]:
        k += 1
    return k


@wp.kernel
def stops_forward(
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
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] colour and opacity
):
    """One thread a slot and lane; slots of other shapes and such as are not seen are left out."""
    i, lane = wp.tid()
    slot = offset + i
    shape = slot_shape[slot]
    if shape < 0:
        return
    state = slot_state[slot]
    if not is_gradient(paint[shape]) or state & COVERED == 0 or state & HIDDEN != 0:
        return
    first = stop_first[shape]
    last = stop_first[shape + 1]
    if not is_chain(spread[shape], focus[shape], stop_offsets, first, last):
        return
    f = frames[shape]
    linear = paint[shape] == LINEAR
    down = to_unit(f, wp.vec2(f[0], f[1] + 1.0 / scale))
    row = rows()
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        top = to_unit(f, pixel_place(slot_tile[slot], tiles_x, x, 0, scale))
        t = column(top[0]) + down[0] * row
        if not linear:
            v = column(top[1]) + down[1] * row
            t = roots(wp.cw_mul(t, t) + wp.cw_mul(v, v))
        low = interval_at(stop_offsets, first, last, wp.min(t))
        high = interval_at(stop_offsets, low, last, wp.max(t))
        color = stop_colors[low]
        red = column(color[0])
        green = column(color[1])
        blue = column(color[2])
        opacity = column(stop_opacities[low])
        for k in range(low, high + 1):
            share = share_of_second(t, stop_offsets[k], stop_offsets[k + 1] - stop_offsets[k])
            between = stop_colors[k + 1] - stop_colors[k]
            red = red + between[0] * share
            green = green + between[1] * share
            blue = blue + between[2] * share
            opacity = opacity + (stop_opacities[k + 1] - stop_opacities[k]) * share
        paint_columns[slot, 0, x] = red
        paint_columns[slot, 1, x] = green
        paint_columns[slot, 2, x] = blue
        paint_columns[slot, 3, x] = opacity


@wp.kernel
def stops_backward(
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
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] gradients of colour and opacity
    # Out:
    frames_grad: wp.array[frame],  # [shape_count] written
    stop_offsets_grad: wp.array[wp.float32],  # [stop_count] written
    stop_colors_grad: wp.array[wp.vec3],  # [stop_count] written
    stop_opacities_grad: wp.array[wp.float32],  # [stop_count] written
):
    """One thread a shape sums its visible slots in a fixed order: the same bits on every run.

    Of a column that reaches the intervals low .. high, the stop low takes all of the gradient but what the
    share of the interval passes on to the next one, and so on.
    """
    shape = offset + wp.tid()
    first = stop_first[shape]
    last = stop_first[shape + 1]
    if not is_gradient(paint[shape]) or not is_chain(spread[shape], focus[shape], stop_offsets, first, last):
        return
    for i in range(first, last):
        stop_offsets_grad[i] = 0.0
        stop_colors_grad[i] = wp.vec3(0.0, 0.0, 0.0)
        stop_opacities_grad[i] = 0.0
    f = frames[shape]
    linear = paint[shape] == LINEAR
    down = to_unit(f, wp.vec2(f[0], f[1] + 1.0 / scale))
    row = rows()
    zero = column(0.0)
    one = column(1.0)
    # Of the place in unit space, and that times each coordinate.
    by_u = zero
    by_v = zero
    u_by_u = zero
    u_by_v = zero
    v_by_u = zero
    v_by_v = zero
    columns = int(TILE)  # a loop that is not unrolled, which takes long to compile
    for slot in range(slot_first[shape], slot_last[shape]):
        state = slot_state[slot]
        if state & COVERED != 0 and state & HIDDEN == 0:
            for x in range(columns):
                top = to_unit(f, pixel_place(slot_tile[slot], tiles_x, x, 0, scale))
                u = column(top[0]) + down[0] * row
                v = column(top[1]) + down[1] * row
                t = u
                if not linear:
                    t = roots(wp.cw_mul(u, u) + wp.cw_mul(v, v))
                red = paint_columns[slot, 0, x]
                green = paint_columns[slot, 1, x]
                blue = paint_columns[slot, 2, x]
                opacity = paint_columns[slot, 3, x]
                low = interval_at(stop_offsets, first, last, wp.min(t))
                high = interval_at(stop_offsets, low, last, wp.max(t))
                color_rest = wp.vec3(total(red), total(green), total(blue))
                opacity_rest = total(opacity)
                by_t = zero
                for k in range(low, high + 1):
                    width = stop_offsets[k + 1] - stop_offsets[k]
                    share = share_of_second(t, stop_offsets[k], width)
                    on = wp.vec3(
                        total(wp.cw_mul(share, red)),
                        total(wp.cw_mul(share, green)),
                        total(wp.cw_mul(share, blue)),
                    )
                    opacity_on = total(wp.cw_mul(share, opacity))
                    stop_colors_grad[k] = stop_colors_grad[k] + (color_rest - on)
                    stop_opacities_grad[k] = stop_opacities_grad[k] + (opacity_rest - opacity_on)
                    color_rest = on
                    opacity_rest = opacity_on
                    between = stop_colors[k + 1] - stop_colors[k]
                    step = between[0] * red + between[1] * green + between[2] * blue
                    step = (step + (stop_opacities[k + 1] - stop_opacities[k]) * opacity) / width
                    # Beyond the stops nothing changes with t.
                    step = wp.cw_mul(step, wp.min(STEEP * share, one))
                    step = wp.cw_mul(step, wp.min(STEEP * (one - share), one))
                    later = total(wp.cw_mul(share, step))
                    stop_offsets_grad[k] = stop_offsets_grad[k] + (later - total(step))
                    stop_offsets_grad[k + 1] = stop_offsets_grad[k + 1] - later
                    by_t = by_t + step
                stop_colors_grad[high + 1] = stop_colors_grad[high + 1] + color_rest
                stop_opacities_grad[high + 1] = stop_opacities_grad[high + 1] + opacity_rest
                if linear:
                    by_u = by_u + by_t
                    u_by_u = u_by_u + wp.cw_mul(u, by_t)
                    v_by_u = v_by_u + wp.cw_mul(v, by_t)
                else:
                    by_t = wp.cw_div(by_t, wp.max(t, column(TINY)))
                    to_u = wp.cw_mul(u, by_t)
                    to_v = wp.cw_mul(v, by_t)
                    by_u = by_u + to_u
                    by_v = by_v + to_v
                    u_by_u = u_by_u + wp.cw_mul(u, to_u)
                    u_by_v = u_by_v + wp.cw_mul(u, to_v)
                    v_by_u = v_by_u + wp.cw_mul(v, to_u)
                    v_by_v = v_by_v + wp.cw_mul(v, to_v)
    # A frame that moves takes the place in unit space the other way.
    origin = to_unit_adjoint(f, wp.vec2(-total(by_u), -total(by_v)))
    along = to_unit_adjoint(f, wp.vec2(-total(u_by_u), -total(u_by_v)))
    across = to_unit_adjoint(f, wp.vec2(-total(v_by_u), -total(v_by_v)))
    frames_grad[shape] = frame(origin[0], origin[1], along[0], along[1], across[0], across[1])
