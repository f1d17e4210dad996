"""Padded gradients from a circle's centre or along a line, column by column: the most common ones.

The same as ``gradient``, as vector arithmetic: along a column of pixels both coordinates in unit space go by
constant steps. The colour at t is that of the first stop and, for each interval, the clamped share of its
second stop times the difference of the two. Two ascending stops (a ramp) have kernels of their own; of more
(a chain, in any order) only those intervals that a column reaches are computed, which are one or two.
"""

import functools
from typing import Any, Literal

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.gradient import (
    GENERAL,
    NAMES,
    RAMP,
    Gradients,
    between_stops,
    case_of,
    is_gradient,
    parameter,
    pixel_place,
    spread_out,
    to_unit,
)

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def rows(column: Any):
    """Return a vector of a column's type with the indices of its pixels."""
    result = type(column)(0.0)
    for i in range(len(column)):
        result[i] = float(i)
    return result


@wp.func
def roots(squares: Any):
    """Return the square root of each element."""
    result = type(squares)(0.0)
    for i in range(len(squares)):
        result[i] = wp.sqrt(squares[i])
    return result


@wp.func
def share_of_second(t: Any, start: wp.float32, width: wp.float32):
    """Return the share of the second stop at parameters ``t``."""
    linear = (t - type(t)(start)) / width
    return wp.min(wp.max(linear, type(t)(0.0)), type(t)(1.0))


@wp.func
def share_of_next(t: Any, before: wp.float32, after: wp.float32):
    """Return the share of an interval's second stop at parameters ``t``; two stops in one place are a
    step.
    """
    if after > before:
        return share_of_second(t, before, after - before)
    one = type(t)(1.0)
    return wp.min(wp.max(constants.STEEP * (t - type(t)(before)) + one, type(t)(0.0)), one)


@wp.func
def color_chain(
    g: Gradients, shape: wp.int32, t: Any, slot: wp.int32, x: wp.int32, paint_columns: wp.array3d[Any]
):
    """Colour a column of pixels at parameters ``t`` of a chain."""
    first = g.stop_first[shape]
    last = g.stop_first[shape + 1]
    lowest = wp.min(t)
    highest = wp.max(t)
    color = g.stop_colors[first]
    red = type(t)(color[0])
    green = type(t)(color[1])
    blue = type(t)(color[2])
    opacity = type(t)(g.stop_opacities[first])
    before = g.stop_offsets[first]
    for k in range(first, last - 1):
        after = wp.max(before, g.stop_offsets[k + 1])
        color = g.stop_colors[k + 1]
        if lowest >= after:
            red = type(t)(color[0])
            green = type(t)(color[1])
            blue = type(t)(color[2])
            opacity = type(t)(g.stop_opacities[k + 1])
        elif highest >= before:
            share = share_of_next(t, before, after)
            between = color - g.stop_colors[k]
            red = red + between[0] * share
            green = green + between[1] * share
            blue = blue + between[2] * share
            opacity = opacity + (g.stop_opacities[k + 1] - g.stop_opacities[k]) * share
        before = after
    paint_columns[slot, 0, x] = red
    paint_columns[slot, 1, x] = green
    paint_columns[slot, 2, x] = blue
    paint_columns[slot, 3, x] = opacity


@functools.cache
def make_forward(column: Any, case: Literal[0, 1, 2]) -> wp.Kernel:
    """Return the kernel of RAMP, CHAIN or GENERAL gradients, in vectors of type ``column``."""
    height = column._length_
    parts = constants.TILE // height  # of a tile's column, a vector each

    @wp.kernel(name=f"{NAMES[case]}_forward", module="unique", module_options=constants.MODULE_OPTIONS)
    def forward(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # columns of a tile that a thread handles
        tiles_x: wp.int32,
        scale: wp.float32,
        slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
        slot_tile: wp.array[wp.int32],  # [slot_capacity]
        slot_state: wp.array[wp.int32],  # [slot_capacity]
        g: Gradients,
        # Out:
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns] colour and opacity
        paint_pixels: wp.array3d[wp.float32],  # [paint_slots, 4, TILE_PIXELS] the same memory
    ):
        """Colour the pixels of visible slots. One thread a slot and lane."""
        i, lane = wp.tid()
        slot = offset + i
        shape = slot_shape[slot]
        if shape < 0:
            return
        state = slot_state[slot]
        if not is_gradient(g.paint[shape]) or state & constants.COVERED == 0 or state & constants.HIDDEN != 0:
            return
        if case_of(g, shape) != case:
            return
        first = g.stop_first[shape]
        last = g.stop_first[shape + 1]
        own_paint = g.paint[shape]
        own_focus = g.focus[shape]
        own_spread = g.spread[shape]
        f = g.frames[shape]
        if case == RAMP:
            start = g.stop_offsets[first]
            width = g.stop_offsets[first + 1] - start
            low = g.stop_colors[first]
            high = g.stop_colors[first + 1]
            low_opacity = g.stop_opacities[first]
            high_opacity = g.stop_opacities[first + 1]
        down = to_unit(f, wp.vec2(f[0], f[1] + 1.0 / scale))
        row = rows(column(0.0))
        for x in range(lane * lane_columns, (lane + 1) * lane_columns):
            if case == GENERAL:
                for y in range(height):
                    place = to_unit(
                        f, pixel_place(slot_tile[slot], tiles_x, x / parts, height * (x % parts) + y, scale)
                    )
                    t = spread_out(own_spread, parameter(own_paint, own_focus, place)[0])
                    at = between_stops(g.stop_offsets, first, last, t[0])
                    color = (1.0 - at.share) * g.stop_colors[at.low] + at.share * g.stop_colors[at.high]
                    p = height * x + y
                    for channel in range(3):
                        paint_pixels[slot, channel, p] = color[channel]
                    opacity = g.stop_opacities[at.low]
                    opacity += at.share * (g.stop_opacities[at.high] - opacity)
                    paint_pixels[slot, 3, p] = opacity
            else:
                top = to_unit(
                    f, pixel_place(slot_tile[slot], tiles_x, x / parts, height * (x % parts), scale)
                )
                ts = column(top[0]) + down[0] * row
                if own_paint != constants.LINEAR:
                    v = column(top[1]) + down[1] * row
                    ts = roots(wp.cw_mul(ts, ts) + wp.cw_mul(v, v))
                if case == RAMP:
                    share = share_of_second(ts, start, width)
                    paint_columns[slot, 0, x] = column(low[0]) + (high[0] - low[0]) * share
                    paint_columns[slot, 1, x] = column(low[1]) + (high[1] - low[1]) * share
                    paint_columns[slot, 2, x] = column(low[2]) + (high[2] - low[2]) * share
                    paint_columns[slot, 3, x] = column(low_opacity) + (high_opacity - low_opacity) * share
                else:
                    color_chain(g, shape, ts, slot, x, paint_columns)

    return forward
