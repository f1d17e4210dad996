"""Compositing into colours that are straight, not premultiplied, as DiffVG has them, and the adjoint.

A pixel is the mean over its area of the colours, black where nothing is: color / opacity x hit. Hit, the
part of it that shapes lie on, is the sum of their coverages, at most 1; compositing (see ``composite``) says
too little of it where shapes meet. The adjoint is that of ``composite_opaque``, with the gradient of hit
added to that of each coverage.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.composite_opaque import slope_of
from warpsplat.kernels.paint.flat import paint_against, paint_times
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

SEEN = wp.constant(constants.SEEN)
NOTHING = wp.constant(constants.NOTHING)
STEEP = wp.constant(1.0e9)  # makes a step of a clamped difference
TINY = wp.constant(1.0e-9)


@wp.kernel
def straight_forward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity; negative: of a gradient or picture
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] of gradients: colour and opacity
    # Out:
    image: wp.array3d[column],  # [tile_count, 4, TILE] colour and opacity
    hit: wp.array2d[column],  # [tile_count, TILE] part of a pixel that shapes lie on
):
    """One thread a tile and lane."""
    i, lane = wp.tid()
    tile = offset + i
    one = column(1.0)
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        t = one
        touched = column(0.0)
        red = column(0.0)
        green = column(0.0)
        blue = column(0.0)
        for k in range(tile_first[tile], tile_stop[tile]):
            paint = list_paint[k]
            slot = list_slot[k]
            opacity = wp.abs(paint[3])
            covered = one
            if slot >= 0:
                covered = wp.abs(coverage[slot, x])
            if opacity > SEEN:
                touched = touched + covered
            share = opacity * wp.cw_mul(covered, t)
            if paint[3] >= 0.0:
                red = red + paint_times(paint, 0, share)
                green = green + paint_times(paint, 1, share)
                blue = blue + paint_times(paint, 2, share)
            else:
                s = wp.max(slot, -1 - slot)
                share = wp.cw_mul(share, paint_columns[s, 3, x])
                red = red + wp.cw_mul(share, paint_columns[s, 0, x])
                green = green + wp.cw_mul(share, paint_columns[s, 1, x])
                blue = blue + wp.cw_mul(share, paint_columns[s, 2, x])
            t = t - share
        touched = wp.min(touched, one)
        factor = wp.cw_div(touched, wp.max(one - t, NOTHING * one))
        image[tile, 0, x] = wp.cw_mul(red, factor)
        image[tile, 1, x] = wp.cw_mul(green, factor)
        image[tile, 2, x] = wp.cw_mul(blue, factor)
        image[tile, 3, x] = one - t
        hit[tile, x] = touched


@wp.kernel
def straight_backward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity; negative: of a gradient or picture
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    law: wp.int32,  # how a coverage follows from s: AREA or PRODUCT
    image: wp.array3d[column],  # [tile_count, 4, TILE] of the forward pass
    hit: wp.array2d[column],  # [tile_count, TILE] of the forward pass
    image_grad: wp.array3d[column],  # [tile_count, 4, TILE]
    # Out:
    light: wp.array2d[column],  # [slot_capacity, lanes] by place in the lists, of the column at hand
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] colours and opacities, replaced by gradients
    sum_grad: wp.array2d[column],  # [slot_capacity, TILE] of s, visible PARTIAL slots; coverage's memory
    slot_columns: wp.array2d[column],  # [slot_capacity, 4] of colour (3) and opacity by pixel row: one lane
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes] the same, summed up: several lanes
):
    """One thread a tile and lane."""
    i, lane = wp.tid()
    tile = offset + i
    start = tile_first[tile]
    stop = tile_stop[tile]
    one = column(1.0)
    zero = column(0.0)
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        red = image_grad[tile, 0, x]
        green = image_grad[tile, 1, x]
        blue = image_grad[tile, 2, x]
        # Gradients of what is premultiplied, and of hit. Opacities that are no longer divided by, and pixels
        # that are hit throughout, have none.
        along = wp.cw_mul(image[tile, 0, x], red)
        along = along + wp.cw_mul(image[tile, 1, x], green)
        along = along + wp.cw_mul(image[tile, 2, x], blue)
        touched = hit[tile, x]
        opaque = image[tile, 3, x]
        divisor = wp.max(opaque, NOTHING * one)
        factor = wp.cw_div(touched, divisor)
        above = wp.min(wp.max(STEEP * (opaque - NOTHING * one), zero), one)
        opaque = image_grad[tile, 3, x] - wp.cw_mul(wp.cw_div(along, divisor), above)
        partly = wp.min(STEEP * (one - touched), one)
        hit_grad = wp.cw_mul(wp.cw_div(along, wp.max(touched, TINY * one)), partly)
        red = wp.cw_mul(red, factor)
        green = wp.cw_mul(green, factor)
        blue = wp.cw_mul(blue, factor)
        t = one
        for k in range(start, stop):
            light[k, lane] = t
            opacity = list_paint[k][3]
            seen = wp.abs(opacity) * t
            slot = list_slot[k]
            if slot >= 0:
                seen = wp.cw_mul(seen, wp.abs(coverage[slot, x]))
            if opacity < 0.0:
                seen = wp.cw_mul(seen, paint_columns[wp.max(slot, -1 - slot), 3, x])
            t = t - seen
        behind = zero
        for n in range(start, stop):
            k = start + stop - 1 - n
            paint = list_paint[k]
            slot = list_slot[k]
            full = slot < 0
            signed = one
            if full:
                slot = -1 - slot
            else:
                signed = coverage[slot, x]
            covered = wp.abs(signed)
            gradient = paint[3] < 0.0
            opacity = wp.abs(paint[3])
            painted = one
            against = opaque
            if gradient:
                painted = paint_columns[slot, 3, x]
                against = against + wp.cw_mul(paint_columns[slot, 0, x], red)
                against = against + wp.cw_mul(paint_columns[slot, 1, x], green)
                against = against + wp.cw_mul(paint_columns[slot, 2, x], blue)
            else:
                against = against + paint_against(paint, red, green, blue)
            t = light[k, lane]
            alpha = opacity * wp.cw_mul(covered, painted)
            own = against - behind
            alpha_grad = wp.cw_mul(t, own)
            behind = behind + wp.cw_mul(alpha, own)
            if not full:
                covered_grad = opacity * wp.cw_mul(painted, alpha_grad)
                if opacity > SEEN:
                    covered_grad = covered_grad + hit_grad
                sum_grad[slot, x] = wp.cw_mul(slope_of(law, signed), covered_grad)
            seen = wp.cw_mul(t, alpha)
            red_grad = wp.cw_mul(seen, red)
            green_grad = wp.cw_mul(seen, green)
            blue_grad = wp.cw_mul(seen, blue)
            opacity_grad = wp.cw_mul(wp.cw_mul(covered, painted), alpha_grad)
            if gradient:
                paint_columns[slot, 0, x] = red_grad
                paint_columns[slot, 1, x] = green_grad
                paint_columns[slot, 2, x] = blue_grad
                paint_columns[slot, 3, x] = opacity * wp.cw_mul(covered, alpha_grad)
            if lane_columns == 1:
                slot_grad[slot, lane] = wp.vec4(
                    total(red_grad), total(green_grad), total(blue_grad), total(opacity_grad)
                )
            else:
                if x > 0:
                    red_grad = red_grad + slot_columns[slot, 0]
                    green_grad = green_grad + slot_columns[slot, 1]
                    blue_grad = blue_grad + slot_columns[slot, 2]
                    opacity_grad = opacity_grad + slot_columns[slot, 3]
                slot_columns[slot, 0] = red_grad
                slot_columns[slot, 1] = green_grad
                slot_columns[slot, 2] = blue_grad
                slot_columns[slot, 3] = opacity_grad
