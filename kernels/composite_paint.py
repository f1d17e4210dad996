"""Compositing of scenes with gradients, or on a transparent canvas, and the adjoint; see ``composite``.

Kernels of their own: the two questions that they ask of every slot make the others a tenth slower.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.flat import paint_against, paint_times
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

AREA = wp.constant(constants.AREA)
TRANSMITTANCE_MIN = wp.constant(constants.TRANSMITTANCE_MIN)
STEEP = wp.constant(1.0e9)  # makes a step of a clamped difference
TINY = wp.constant(1.0e-9)
SAME = wp.constant(constants.SAME)


@wp.kernel
def paint_forward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    tile_still: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] of gradients: colour and opacity
    background: wp.vec3,
    # Out:
    image: wp.array3d[column],  # [tile_count, planes, TILE]
):
    """One thread a tile and lane. A tile that is the same as in the last pass stays as it is."""
    i, lane = wp.tid()
    tile = offset + i
    if tile_still[tile] == SAME:
        return
    start = tile_first[tile]
    stop = tile_stop[tile]
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        t = column(1.0)
        red = column(0.0)
        green = column(0.0)
        blue = column(0.0)
        for k in range(start, stop):
            paint = list_paint[k]
            slot = list_slot[k]
            share = wp.abs(paint[3]) * t
            if slot >= 0:
                share = wp.cw_mul(share, wp.abs(coverage[slot, x]))
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
        image[tile, 0, x] = red + background[0] * t
        image[tile, 1, x] = green + background[1] * t
        image[tile, 2, x] = blue + background[2] * t
        if image.shape[1] == 4:
            image[tile, 3, x] = column(1.0) - t


@wp.kernel
def paint_backward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    tile_still: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity]
    list_paint: wp.array[wp.vec4],  # [slot_capacity]
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    law: wp.int32,  # how a coverage follows from s: AREA or PRODUCT
    image: wp.array3d[column],  # [tile_count, planes, TILE] of the forward pass
    image_grad: wp.array3d[column],  # [tile_count, planes, TILE]
    # Out:
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] replaced by their gradients
    sum_grad: wp.array2d[column],  # [slot_capacity, TILE] of s, visible PARTIAL slots; coverage's memory
    slot_columns: wp.array2d[column],  # [slot_capacity, 4] of colour (3) and opacity by pixel row: one lane
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes] the same, summed up: several lanes
):
    """See the module. The gradient of s takes the place of the coverage, which is not needed any more: this
    stage waits for memory. Tiles that are still have no gradient that is asked for.
    """
    i, lane = wp.tid()
    tile = offset + i
    if tile_still[tile] != 0:
        return
    start = tile_first[tile]
    stop = tile_stop[tile]
    one = column(1.0)
    zero = column(0.0)
    least = column(TINY)
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        red = image_grad[tile, 0, x]
        green = image_grad[tile, 1, x]
        blue = image_grad[tile, 2, x]
        behind = wp.cw_mul(image[tile, 0, x], red)
        behind = behind + wp.cw_mul(image[tile, 1, x], green)
        behind = behind + wp.cw_mul(image[tile, 2, x], blue)
        opaque = zero
        if image.shape[1] == 4:
            opaque = image_grad[tile, 3, x]
            behind = behind + wp.cw_mul(image[tile, 3, x], opaque)
        t = one
        for k in range(start, stop):
            paint = list_paint[k]
            slot = list_slot[k]
            full = slot < 0
            covered = one
            signed = one
            if full:
                slot = -1 - slot
            else:
                signed = coverage[slot, x]
                covered = wp.abs(signed)
            gradient = paint[3] < 0.0
            opacity = wp.abs(paint[3])
            alpha = opacity * covered
            own = covered
            share = opaque
            if gradient:
                own = wp.cw_mul(own, paint_columns[slot, 3, x])
                alpha = opacity * own
                share = share + wp.cw_mul(paint_columns[slot, 0, x], red)
                share = share + wp.cw_mul(paint_columns[slot, 1, x], green)
                share = share + wp.cw_mul(paint_columns[slot, 2, x], blue)
            else:
                share = share + paint_against(paint, red, green, blue)
            share = wp.cw_mul(t, share)
            seen = wp.cw_mul(t, alpha)
            behind = behind - wp.cw_mul(alpha, share)
            # Where no light is left, only rounding is; Adam would make steps of it.
            lit = wp.min(wp.max(STEEP * (t - TRANSMITTANCE_MIN * one), zero), one)
            alpha_grad = wp.cw_mul(lit, share - wp.cw_div(behind, wp.max(one - alpha, least)))
            t = t - seen
            if not full:
                # d coverage / ds: the sign of s, 0 where it is clamped; or what the product leaves.
                slope = one - covered
                if law == AREA:
                    slope = wp.min(STEEP * slope, one)
                    slope = wp.cw_mul(slope, wp.min(wp.max(STEEP * signed, -one), one))
                slope = opacity * wp.cw_mul(slope, alpha_grad)
                if gradient:
                    slope = wp.cw_mul(slope, paint_columns[slot, 3, x])
                sum_grad[slot, x] = slope
            red_grad = wp.cw_mul(seen, red)
            green_grad = wp.cw_mul(seen, green)
            blue_grad = wp.cw_mul(seen, blue)
            opacity_grad = wp.cw_mul(own, alpha_grad)
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
