"""Padded gradients of three stops or more, column by column: linear ones and those of a circle's centre.

The same as ``gradient``, as vector arithmetic like ``ramp``. The colour at t is that of the first
stop and, for each interval, the clamped share of its second stop times the difference of the two: only those
that a column reaches are computed, which are one or two.
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

STEEP = wp.constant(1.0e9)  # makes a step of a clamped share
TINY = wp.constant(1.0e-12)


@wp.func
def share_of_next(t: column, before: wp.float32, after: wp.float32) -> column:
    """Return the share of an interval's second stop at parameters ``t``; two stops in one place are a
    step.
    """
    if after > before:
        return share_of_second(t, before, after - before)
    return wp.min(wp.max(STEEP * (t - column(before)) + column(1.0), column(0.0)), column(1.0))


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
    """Colour the pixels of visible slots whose gradients this file handles. One thread a slot and lane."""
    i, lane = wp.tid()
    slot = offset + i
    shape = slot_shape[slot]
    if shape < 0:
        return
    state = slot_state[slot]
    if not is_gradient(paint[shape]) or state & constants.COVERED == 0 or state & constants.HIDDEN != 0:
        return
    first = stop_first[shape]
    last = stop_first[shape + 1]
    if not is_chain(spread[shape], focus[shape], first, last):
        return
    f = frames[shape]
    linear = paint[shape] == constants.LINEAR
    down = to_unit(f, wp.vec2(f[0], f[1] + 1.0 / scale))
    row = rows()
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        top = to_unit(f, pixel_place(slot_tile[slot], tiles_x, x, 0, scale))
        t = column(top[0]) + down[0] * row
        if not linear:
            v = column(top[1]) + down[1] * row
            t = roots(wp.cw_mul(t, t) + wp.cw_mul(v, v))
        lowest = wp.min(t)
        highest = wp.max(t)
        color = stop_colors[first]
        red = column(color[0])
        green = column(color[1])
        blue = column(color[2])
        opacity = column(stop_opacities[first])
        before = stop_offsets[first]
        for k in range(first, last - 1):
            after = wp.max(before, stop_offsets[k + 1])
            color = stop_colors[k + 1]
            if lowest >= after:
                red = column(color[0])
                green = column(color[1])
                blue = column(color[2])
                opacity = column(stop_opacities[k + 1])
            elif highest >= before:
                share = share_of_next(t, before, after)
                between = color - stop_colors[k]
                red = red + between[0] * share
                green = green + between[1] * share
                blue = blue + between[2] * share
                opacity = opacity + (stop_opacities[k + 1] - stop_opacities[k]) * share
            before = after
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
    """Sum over a shape's visible slots in a fixed order: the same bits on every run. One thread a shape.

    The first stop takes all of a column's gradient but what the share of its interval passes on to the next
    one, and so on. The offset of a stop that counts as lying where one before it does has no gradient.
    """
    shape = offset + wp.tid()
    first = stop_first[shape]
    last = stop_first[shape + 1]
    if not is_gradient(paint[shape]) or not is_chain(spread[shape], focus[shape], first, last):
        return
    for i in range(first, last):
        stop_offsets_grad[i] = 0.0
        stop_colors_grad[i] = wp.vec3(0.0, 0.0, 0.0)
        stop_opacities_grad[i] = 0.0
    f = frames[shape]
    linear = paint[shape] == constants.LINEAR
    down = to_unit(f, wp.vec2(f[0], f[1] + 1.0 / scale))
    row = rows()
    zero = column(0.0)
    one = column(1.0)
    # Derivatives by the point in unit space, and the same times each coordinate.
    by_u = zero
    by_v = zero
    u_by_u = zero
    u_by_v = zero
    v_by_u = zero
    v_by_v = zero
    columns = int(constants.TILE)  # a loop that is not unrolled, which takes long to compile
    for slot in range(slot_first[shape], slot_last[shape]):
        state = slot_state[slot]
        if state & constants.COVERED != 0 and state & constants.HIDDEN == 0:
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
                lowest = wp.min(t)
                highest = wp.max(t)
                color_rest = wp.vec3(total(red), total(green), total(blue))
                opacity_rest = total(opacity)
                by_t = zero
                at = first
                before = stop_offsets[first]
                own_before = int(1)
                for k in range(first, last - 1):
                    after = wp.max(before, stop_offsets[k + 1])
                    own = wp.where(stop_offsets[k + 1] >= before, 1, 0)
                    if lowest >= after:
                        at = k + 1
                    elif highest >= before:
                        share = share_of_next(t, before, after)
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
                        at = k + 1
                        if after > before:
                            between = stop_colors[k + 1] - stop_colors[k]
                            step = between[0] * red + between[1] * green + between[2] * blue
                            step = step + (stop_opacities[k + 1] - stop_opacities[k]) * opacity
                            step = step / (after - before)
                            # Beyond the two stops nothing changes with t.
                            step = wp.cw_mul(step, wp.min(STEEP * share, one))
                            step = wp.cw_mul(step, wp.min(STEEP * (one - share), one))
                            later = total(wp.cw_mul(share, step))
                            if own_before == 1:
                                stop_offsets_grad[k] = stop_offsets_grad[k] + (later - total(step))
                            if own == 1:
                                stop_offsets_grad[k + 1] = stop_offsets_grad[k + 1] - later
                            by_t = by_t + step
                    before = after
                    own_before = own
                stop_colors_grad[at] = stop_colors_grad[at] + color_rest
                stop_opacities_grad[at] = stop_opacities_grad[at] + opacity_rest
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
    # A frame that moves shifts the points in unit space the other way.
    origin = to_unit_adjoint(f, wp.vec2(-total(by_u), -total(by_v)))
    along = to_unit_adjoint(f, wp.vec2(-total(u_by_u), -total(u_by_v)))
    across = to_unit_adjoint(f, wp.vec2(-total(v_by_u), -total(v_by_v)))
    frames_grad[shape] = frame(origin[0], origin[1], along[0], along[1], across[0], across[1])
