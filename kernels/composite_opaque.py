"""The adjoint of compositing for opacities up to 1, flat or with gradients; see ``composite``.

dL/d alpha_i = T_i (dot(c_i, G) - B_i), where B_i is dot(b_i, G) of the colour b_i that is seen where shape i
and all in front of it are taken away. The other adjoint divides by 1 - alpha_i to find B_i, of which an
opaque shape leaves nothing. Here one walk from the front keeps the light T_i that arrives at each slot, and
one from the back, from the background on, has B_{i-1} = B_i + alpha_i (dot(c_i, G) - B_i). The lists go one
opaque shape further back than what is seen (``most`` of ``bins.list_visible``): what is behind it says what
its opacity is worth. (The same lines in both kernels: as a function, they are not kept in registers.)
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.flat import paint_against
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

AREA = wp.constant(constants.AREA)
STEEP = wp.constant(1.0e9)  # makes a step of a clamped difference


@wp.func
def slope_of(law: wp.int32, signed: column) -> column:
    """d coverage / ds: the sign of s, 0 where it is clamped; or what the product leaves."""
    slope = column(1.0) - wp.abs(signed)
    if law == AREA:
        slope = wp.min(STEEP * slope, column(1.0))
        slope = wp.cw_mul(slope, wp.min(wp.max(STEEP * signed, column(-1.0)), column(1.0)))
    return slope


@wp.kernel
def opaque_backward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    law: wp.int32,  # how a coverage follows from s: AREA or PRODUCT
    image_grad: wp.array3d[column],  # [tile_count, 3, TILE]
    background: wp.vec3,
    # Out:
    light: wp.array2d[column],  # [slot_capacity, lanes] by place in the lists, of the column at hand
    sum_grad: wp.array2d[column],  # [slot_capacity, TILE] of s, visible PARTIAL slots; coverage's memory
    slot_columns: wp.array2d[column],  # [slot_capacity, 4] of colour (3) and opacity by pixel row: one lane
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes] the same, summed up: several lanes
):
    """Where all is flat and the canvas has a background. One thread a tile and lane."""
    i, lane = wp.tid()
    tile = offset + i
    start = tile_first[tile]
    stop = tile_stop[tile]
    one = column(1.0)
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        red = image_grad[tile, 0, x]
        green = image_grad[tile, 1, x]
        blue = image_grad[tile, 2, x]
        t = one
        for k in range(start, stop):
            light[k, lane] = t
            seen = list_paint[k][3] * t
            slot = list_slot[k]
            if slot >= 0:
                seen = wp.cw_mul(seen, wp.abs(coverage[slot, x]))
            t = t - seen
        behind = background[0] * red + background[1] * green + background[2] * blue
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
            alpha = paint[3] * covered
            t = light[k, lane]
            own = paint_against(paint, red, green, blue) - behind
            alpha_grad = wp.cw_mul(t, own)
            behind = behind + wp.cw_mul(alpha, own)
            if not full:
                sum_grad[slot, x] = paint[3] * wp.cw_mul(slope_of(law, signed), alpha_grad)
            seen = wp.cw_mul(t, alpha)
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
def opaque_paint_backward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity; negative: of a gradient or picture
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    law: wp.int32,  # how a coverage follows from s: AREA or PRODUCT
    image_grad: wp.array3d[column],  # [tile_count, planes, TILE]
    background: wp.vec3,
    # Out:
    light: wp.array2d[column],  # [slot_capacity, lanes] by place in the lists, of the column at hand
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] colours and opacities, replaced by gradients
    sum_grad: wp.array2d[column],  # [slot_capacity, TILE] of s, visible PARTIAL slots; coverage's memory
    slot_columns: wp.array2d[column],  # [slot_capacity, 4] of colour (3) and opacity by pixel row: one lane
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes] the same, summed up: several lanes
):
    """Of any paints and canvas. A fourth plane is a colour that all shapes have, and not the background."""
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
        opaque = zero
        if image_grad.shape[1] == 4:
            opaque = image_grad[tile, 3, x]
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
        behind = background[0] * red + background[1] * green + background[2] * blue
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
                sum_grad[slot, x] = opacity * wp.cw_mul(wp.cw_mul(slope_of(law, signed), painted), alpha_grad)
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
