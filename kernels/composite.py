"""Coverage -> image by front-to-back alpha blending (paper eq. 8, once a shape), and the adjoint.

alpha = opacity x coverage; C = sum_i c_i alpha_i prod_{j<i} (1 - alpha_j) + background x what is left.
Both directions run front to back. The adjoint starts from total = dot(C, dL/dC), subtracts each shape's own
share and so knows the share of all that lies behind, without stored lists:
dL/d alpha_i = T_i dot(c_i, G) - behind_i / (1 - alpha_i).
A coverage may come from splats or from any other model: this stage knows only the tiles' lists of visible
slots. It takes the magnitude (an exact fill stores which way round it is as a sign), and 1 throughout a FULL
slot. A flat paint comes with the lists; of a gradient (``composite_paint``) the colours of a slot's pixels
lie in memory as its coverage does. A transparent canvas has a fourth plane: how opaque a pixel is, as a
colour that all shapes have and the background has not. Images are arrays of tiles, planes and columns (see
``warpsplat.tiles``).
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
def composite_forward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    tile_still: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    background: wp.vec3,
    # Out:
    image: wp.array3d[column],  # [tile_count, 3, TILE]
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
            share = paint[3] * t
            if slot >= 0:
                share = wp.cw_mul(share, wp.abs(coverage[slot, x]))
            red = red + paint_times(paint, 0, share)
            green = green + paint_times(paint, 1, share)
            blue = blue + paint_times(paint, 2, share)
            t = t - share
        image[tile, 0, x] = red + background[0] * t
        image[tile, 1, x] = green + background[1] * t
        image[tile, 2, x] = blue + background[2] * t


@wp.kernel
def composite_backward(
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
    image: wp.array3d[column],  # [tile_count, 3, TILE] of the forward pass
    image_grad: wp.array3d[column],  # [tile_count, 3, TILE]
    # Out:
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
            alpha = paint[3] * covered
            share = wp.cw_mul(t, paint_against(paint, red, green, blue))
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
                sum_grad[slot, x] = paint[3] * wp.cw_mul(slope, alpha_grad)
            red_grad = wp.cw_mul(seen, red)
            green_grad = wp.cw_mul(seen, green)
            blue_grad = wp.cw_mul(seen, blue)
            opacity_grad = wp.cw_mul(covered, alpha_grad)
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


@wp.kernel
def removal_cost(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity]
    list_paint: wp.array[wp.vec4],  # [slot_capacity]
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE]
    image: wp.array3d[column],  # [tile_count, planes, TILE] of the forward pass
    target: wp.array3d[column],  # [tile_count, planes, TILE]
    importance: wp.array2d[column],  # [tile_count, TILE] weight of a pixel, 0 outside of the image
    # Out:
    slot_cost: wp.array2d[wp.float32],  # [slot_capacity, lanes] sum over pixels and channels; others kept
):
    """What the weighted squared error would grow by if a shape alone were taken away.

    Behind a shape lies the colour b = rest / T; without it a pixel changes by d = T alpha (b - c), and its
    squared error by 2 d . (image - target) + d . d. On a transparent canvas the error is the mean of those on
    black and on white, where what is not covered is white.
    """
    i, lane = wp.tid()
    tile = offset + i
    one = column(1.0)
    zero = column(0.0)
    planes = image.shape[1]
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        t = one
        red = image[tile, 0, x]
        green = image[tile, 1, x]
        blue = image[tile, 2, x]
        opaque = one
        red_error = 2.0 * (red - target[tile, 0, x])
        green_error = 2.0 * (green - target[tile, 1, x])
        blue_error = 2.0 * (blue - target[tile, 2, x])
        opaque_error = zero
        if planes == 4:
            opaque = image[tile, 3, x]
            opaque_error = 2.0 * (opaque - target[tile, 3, x])
        for k in range(tile_first[tile], tile_stop[tile]):
            paint = list_paint[k]
            slot = list_slot[k]
            seen = wp.abs(paint[3]) * t
            if slot >= 0:
                seen = wp.cw_mul(seen, wp.abs(coverage[slot, x]))
            else:
                slot = -1 - slot
            if paint[3] < 0.0:
                seen = wp.cw_mul(seen, paint_columns[slot, 3, x])
            lit = wp.min(wp.max(STEEP * (t - TRANSMITTANCE_MIN * one), zero), one)
            t = t - seen
            red_seen = paint_times(paint, 0, seen)
            green_seen = paint_times(paint, 1, seen)
            blue_seen = paint_times(paint, 2, seen)
            if paint[3] < 0.0:
                red_seen = wp.cw_mul(seen, paint_columns[slot, 0, x])
                green_seen = wp.cw_mul(seen, paint_columns[slot, 1, x])
                blue_seen = wp.cw_mul(seen, paint_columns[slot, 2, x])
            red = red - red_seen
            green = green - green_seen
            blue = blue - blue_seen
            share = wp.cw_div(seen, wp.max(t, TINY * one))
            red_seen = wp.cw_mul(share, red) - red_seen
            green_seen = wp.cw_mul(share, green) - green_seen
            blue_seen = wp.cw_mul(share, blue) - blue_seen
            cost = wp.cw_mul(red_seen, red_seen + red_error)
            cost = cost + wp.cw_mul(green_seen, green_seen + green_error)
            cost = cost + wp.cw_mul(blue_seen, blue_seen + blue_error)
            if planes == 4:
                opaque = opaque - seen
                d = wp.cw_mul(share, opaque) - seen
                cost = 0.5 * cost
                cost = cost + 0.5 * wp.cw_mul(red_seen - d, red_seen - d + red_error - opaque_error)
                cost = cost + 0.5 * wp.cw_mul(green_seen - d, green_seen - d + green_error - opaque_error)
                cost = cost + 0.5 * wp.cw_mul(blue_seen - d, blue_seen - d + blue_error - opaque_error)
            cost = wp.cw_mul(cost, wp.cw_mul(lit, importance[tile, x]))
            slot_cost[slot, lane] = slot_cost[slot, lane] + total(cost)
