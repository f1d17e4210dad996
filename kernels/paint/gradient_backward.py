"""Adjoint of ``gradient_forward``: derivatives by stops, frames and foci, column by column."""

import functools
from typing import Any, Literal

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.gradient import (
    GENERAL,
    NAMES,
    RAMP,
    TINY,
    Gradients,
    between_stops,
    case_of,
    frame,
    is_gradient,
    parameter,
    pixel_place,
    spread_out,
    to_unit,
    to_unit_adjoint,
)
from warpsplat.kernels.paint.gradient_forward import (
    roots,
    rows,
    share_of_next,
    share_of_second,
)
from warpsplat.kernels.tile import total

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def chain_backward_column(
    g: Gradients,
    shape: wp.int32,
    t: Any,
    slot: wp.int32,
    x: wp.int32,
    paint_columns: wp.array3d[Any],
    stop_offsets_grad: wp.array[wp.float32],
    stop_colors_grad: wp.array[wp.vec3],
    stop_opacities_grad: wp.array[wp.float32],
):
    """Add the gradients of a chain's stops in a column of pixels; return those of ``t``.

    The first stop takes all of a column's gradient but what the share of its interval passes on to the next
    one, and so on. The offset of a stop that counts as lying where one before it does has no gradient.
    """
    red = paint_columns[slot, 0, x]
    green = paint_columns[slot, 1, x]
    blue = paint_columns[slot, 2, x]
    opacity = paint_columns[slot, 3, x]
    first = g.stop_first[shape]
    last = g.stop_first[shape + 1]
    lowest = wp.min(t)
    highest = wp.max(t)
    color_rest = wp.vec3(total(red), total(green), total(blue))
    opacity_rest = total(opacity)
    slope = type(t)(0.0)
    at = first
    before = g.stop_offsets[first]
    own_before = int(1)
    for k in range(first, last - 1):
        after = wp.max(before, g.stop_offsets[k + 1])
        own = wp.where(g.stop_offsets[k + 1] >= before, 1, 0)
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
                between = g.stop_colors[k + 1] - g.stop_colors[k]
                step = between[0] * red + between[1] * green + between[2] * blue
                step = step + (g.stop_opacities[k + 1] - g.stop_opacities[k]) * opacity
                step = step / (after - before)
                # Beyond the two stops nothing changes with t.
                step = wp.cw_mul(step, wp.min(constants.STEEP * share, type(t)(1.0)))
                step = wp.cw_mul(step, wp.min(constants.STEEP * (type(t)(1.0) - share), type(t)(1.0)))
                later = total(wp.cw_mul(share, step))
                if own_before == 1:
                    stop_offsets_grad[k] = stop_offsets_grad[k] + (later - total(step))
                if own == 1:
                    stop_offsets_grad[k + 1] = stop_offsets_grad[k + 1] - later
                slope = slope + step
        before = after
        own_before = own
    stop_colors_grad[at] = stop_colors_grad[at] + color_rest
    stop_opacities_grad[at] = stop_opacities_grad[at] + opacity_rest
    return slope


@wp.kernel
def gradient_backward(
    # In:
    offset: wp.int32,
    tiles_x: wp.int32,
    scale: wp.float32,
    slot_range: wp.array[wp.vec2i],  # [shape_count]
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    g: Gradients,
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
    if not is_gradient(g.paint[shape]):
        return
    if case_of(g, shape) != GENERAL:
        return
    first = g.stop_first[shape]
    last = g.stop_first[shape + 1]
    for i in range(first, last):
        stop_offsets_grad[i] = 0.0
        stop_colors_grad[i] = wp.vec3(0.0, 0.0, 0.0)
        stop_opacities_grad[i] = 0.0
    f = g.frames[shape]
    origin = wp.vec2(0.0, 0.0)
    along = wp.vec2(0.0, 0.0)
    across = wp.vec2(0.0, 0.0)
    slots = slot_range[shape]
    for slot in range(slots[0], slots[1]):
        state = slot_state[slot]
        if state & constants.COVERED != 0 and state & constants.HIDDEN == 0:
            for p in range(constants.TILE * constants.TILE):
                color = wp.vec3(paint_pixels[slot, 0, p], paint_pixels[slot, 1, p], paint_pixels[slot, 2, p])
                opacity = paint_pixels[slot, 3, p]
                place = to_unit(
                    f, pixel_place(slot_tile[slot], tiles_x, p / constants.TILE, p % constants.TILE, scale)
                )
                raw = parameter(g.paint[shape], g.focus[shape], place)
                t = spread_out(g.spread[shape], raw[0])
                at = between_stops(g.stop_offsets, first, last, t[0])
                low_share = 1.0 - at.share
                stop_colors_grad[at.low] = stop_colors_grad[at.low] + low_share * color
                stop_colors_grad[at.high] = stop_colors_grad[at.high] + at.share * color
                stop_opacities_grad[at.low] = stop_opacities_grad[at.low] + low_share * opacity
                stop_opacities_grad[at.high] = stop_opacities_grad[at.high] + at.share * opacity
                if at.width > 0.0:
                    step = wp.dot(color, g.stop_colors[at.high] - g.stop_colors[at.low])
                    step += opacity * (g.stop_opacities[at.high] - g.stop_opacities[at.low])
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


@functools.cache
def make_backward(column: Any, case: Literal[0, 1, 2]) -> wp.Kernel:
    """Return the adjoint of RAMP, CHAIN or GENERAL gradients, in vectors of type ``column``."""
    if case == GENERAL:
        return gradient_backward
    height = column._length_
    parts = constants.TILE // height  # of a tile's column, a vector each

    @wp.kernel(name=f"{NAMES[case]}_backward", module="unique", module_options=constants.MODULE_OPTIONS)
    def backward(
        # In:
        offset: wp.int32,
        tiles_x: wp.int32,
        scale: wp.float32,
        slot_range: wp.array[wp.vec2i],  # [shape_count]
        slot_tile: wp.array[wp.int32],  # [slot_capacity]
        slot_state: wp.array[wp.int32],  # [slot_capacity]
        g: Gradients,
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns] gradients of colour and opacity
        # Out:
        frames_grad: wp.array[frame],  # [shape_count] written
        stop_offsets_grad: wp.array[wp.float32],  # [stop_count] written
        stop_colors_grad: wp.array[wp.vec3],  # [stop_count] written
        stop_opacities_grad: wp.array[wp.float32],  # [stop_count] written
    ):
        """Sum over a shape's visible slots in a fixed order: the same bits on every run. The focus is treated
        as a constant. One thread a shape.
        """
        shape = offset + wp.tid()
        if not is_gradient(g.paint[shape]):
            return
        if case_of(g, shape) != case:
            return
        first = g.stop_first[shape]
        last = g.stop_first[shape + 1]
        f = g.frames[shape]
        zero = column(0.0)
        one = column(1.0)
        if case == RAMP:
            start = g.stop_offsets[first]
            width = g.stop_offsets[first + 1] - start
            between = g.stop_colors[first + 1] - g.stop_colors[first]
            opacity_between = g.stop_opacities[first + 1] - g.stop_opacities[first]
            red = zero
            green = zero
            blue = zero
            opacity = zero
            red_high = zero
            green_high = zero
            blue_high = zero
            opacity_high = zero
            by_t = zero
            by_t_high = zero
        else:
            for i in range(first, last):
                stop_offsets_grad[i] = 0.0
                stop_colors_grad[i] = wp.vec3(0.0, 0.0, 0.0)
                stop_opacities_grad[i] = 0.0
        linear = g.paint[shape] == constants.LINEAR
        down = to_unit(f, wp.vec2(f[0], f[1] + 1.0 / scale))
        row = rows(column(0.0))
        # Derivatives by the point in unit space, and the same times each coordinate.
        by_u = zero
        by_v = zero
        u_by_u = zero
        u_by_v = zero
        v_by_u = zero
        v_by_v = zero
        columns = int(constants.TILE * parts)  # not unrolled, which takes long to compile
        slots = slot_range[shape]
        for slot in range(slots[0], slots[1]):
            state = slot_state[slot]
            if state & constants.COVERED != 0 and state & constants.HIDDEN == 0:
                for x in range(columns):
                    top = to_unit(
                        f, pixel_place(slot_tile[slot], tiles_x, x / parts, height * (x % parts), scale)
                    )
                    u = column(top[0]) + down[0] * row
                    v = column(top[1]) + down[1] * row
                    t = u
                    if not linear:
                        t = roots(wp.cw_mul(u, u) + wp.cw_mul(v, v))
                    if case == RAMP:
                        share = share_of_second(t, start, width)
                        g_red = paint_columns[slot, 0, x]
                        g_green = paint_columns[slot, 1, x]
                        g_blue = paint_columns[slot, 2, x]
                        g_opacity = paint_columns[slot, 3, x]
                        red = red + g_red
                        green = green + g_green
                        blue = blue + g_blue
                        opacity = opacity + g_opacity
                        red_high = red_high + wp.cw_mul(share, g_red)
                        green_high = green_high + wp.cw_mul(share, g_green)
                        blue_high = blue_high + wp.cw_mul(share, g_blue)
                        opacity_high = opacity_high + wp.cw_mul(share, g_opacity)
                        slope = between[0] * g_red + between[1] * g_green + between[2] * g_blue
                        slope = (slope + opacity_between * g_opacity) / width
                        # Beyond the stops nothing changes with t.
                        slope = wp.cw_mul(slope, wp.min(constants.STEEP * share, one))
                        slope = wp.cw_mul(slope, wp.min(constants.STEEP * (one - share), one))
                        by_t = by_t + slope
                        by_t_high = by_t_high + wp.cw_mul(share, slope)
                    else:
                        slope = chain_backward_column(
                            g,
                            shape,
                            t,
                            slot,
                            x,
                            paint_columns,
                            stop_offsets_grad,
                            stop_colors_grad,
                            stop_opacities_grad,
                        )
                    if linear:
                        by_u = by_u + slope
                        u_by_u = u_by_u + wp.cw_mul(u, slope)
                        v_by_u = v_by_u + wp.cw_mul(v, slope)
                    else:
                        slope = wp.cw_div(slope, wp.max(t, column(TINY)))
                        to_u = wp.cw_mul(u, slope)
                        to_v = wp.cw_mul(v, slope)
                        by_u = by_u + to_u
                        by_v = by_v + to_v
                        u_by_u = u_by_u + wp.cw_mul(u, to_u)
                        u_by_v = u_by_v + wp.cw_mul(u, to_v)
                        v_by_u = v_by_u + wp.cw_mul(v, to_u)
                        v_by_v = v_by_v + wp.cw_mul(v, to_v)
        if case == RAMP:
            high = wp.vec3(total(red_high), total(green_high), total(blue_high))
            stop_colors_grad[first] = wp.vec3(total(red), total(green), total(blue)) - high
            stop_colors_grad[first + 1] = high
            stop_opacities_grad[first] = total(opacity) - total(opacity_high)
            stop_opacities_grad[first + 1] = total(opacity_high)
            stop_offsets_grad[first] = total(by_t_high) - total(by_t)
            stop_offsets_grad[first + 1] = -total(by_t_high)
        # A frame that moves shifts the points in unit space the other way.
        origin = to_unit_adjoint(f, wp.vec2(-total(by_u), -total(by_v)))
        along = to_unit_adjoint(f, wp.vec2(-total(u_by_u), -total(u_by_v)))
        across = to_unit_adjoint(f, wp.vec2(-total(v_by_u), -total(v_by_v)))
        frames_grad[shape] = frame(origin[0], origin[1], along[0], along[1], across[0], across[1])

    return backward


@wp.kernel
def tie_circles(
    # In:
    offset: wp.int32,
    circular: wp.array[wp.int32],  # [shape_count] 1 where the frame is a circle's
    # Out:
    frames_grad: wp.array[frame],  # [shape_count] updated
):
    """Keep circles round: the second axis is the first one, turned by a right angle."""
    i = offset + wp.tid()
    if circular[i] == 1:
        g = frames_grad[i]
        x = g[2] + g[5]
        y = g[3] - g[4]
        frames_grad[i] = frame(g[0], g[1], x, y, -y, x)
