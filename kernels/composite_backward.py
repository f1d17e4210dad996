"""The adjoint of compositing; see ``composite``.

It runs front to back as well. It starts from total = dot(C, dL/dC), subtracts each shape's own share and so
knows the share of all that lies behind, without stored lists:
dL/d alpha_i = T_i dot(c_i, G) - behind_i / (1 - alpha_i).
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.flat import paint_against
from warpsplat.kernels.tile import tile_column, total

wp.set_module_options(constants.MODULE_OPTIONS)

STEEPER = wp.constant(1.0e30)  # the same for coverages, which may be so small that they are not seen
TINY = wp.constant(1.0e-9)


@wp.func
def slope_of(mapping: wp.int32, signed: Any):
    """Return d coverage / ds: the sign of s, 0 where it is clamped; or what the product leaves."""
    one = type(signed)(1.0)
    slope = one - wp.abs(signed)
    if mapping == constants.AREA:
        slope = wp.min(constants.STEEP * slope, one)
        slope = wp.cw_mul(slope, wp.min(wp.max(STEEPER * signed, -one), one))
    return slope


@functools.cache
def make_backward(column: Any, *, painted: bool) -> wp.Kernel:
    """Return the adjoint for opacities below 1.

    Args:
        column: type of its vectors of pixels.
        painted: whether there may be gradients and pictures, or a transparent canvas.
    """
    single_lane = column is tile_column
    name = "paint_backward" if painted else "composite_backward"

    @wp.kernel(name=name, module="unique", module_options=constants.MODULE_OPTIONS)
    def backward(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # columns of a tile that a thread handles
        tile_range: wp.array[wp.vec2i],  # [tile_count]
        tile_cache: wp.array[wp.int32],  # [tile_count]
        list_slot: wp.array[wp.int32],  # [slot_capacity]
        list_paint: wp.array[wp.vec4],  # [slot_capacity]
        coverage: wp.array2d[column],  # [slot_capacity, columns]
        mapping: wp.int32,  # how a coverage follows from s: AREA or PRODUCT
        image: wp.array3d[column],  # [tile_count, planes, columns] of the forward pass
        image_grad: wp.array3d[column],  # [tile_count, planes, columns]
        # Out:
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns] replaced by their gradients
        sum_grad: wp.array2d[column],  # [slot_capacity, columns] of visible PARTIAL slots; coverage's memory
        slot_columns: wp.array2d[column],  # [slot_capacity, 4] of colour (3), opacity by pixel row: one lane
        slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes] the same, summed up: several lanes
    ):
        """One thread a tile and lane. The gradient of s overwrites the coverage, which is no longer needed:
        this stage is bound by memory. Nothing asks for gradients of cached tiles.
        """
        i, lane = wp.tid()
        tile = offset + i
        if tile_cache[tile] != 0:
            return
        visible = tile_range[tile]
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
            if painted:
                opaque = zero
                if image.shape[1] == 4:
                    opaque = image_grad[tile, 3, x]
                    behind = behind + wp.cw_mul(image[tile, 3, x], opaque)
            transmittance = one
            for k in range(visible[0], visible[1]):
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
                opacity = wp.abs(paint[3])
                own = covered
                if painted:
                    gradient = paint[3] < 0.0
                    share = opaque
                    if gradient:
                        own = wp.cw_mul(own, paint_columns[slot, 3, x])
                        share = share + wp.cw_mul(paint_columns[slot, 0, x], red)
                        share = share + wp.cw_mul(paint_columns[slot, 1, x], green)
                        share = share + wp.cw_mul(paint_columns[slot, 2, x], blue)
                    else:
                        share = share + paint_against(paint, red, green, blue)
                else:
                    share = paint_against(paint, red, green, blue)
                alpha = opacity * own
                share = wp.cw_mul(transmittance, share)
                seen = wp.cw_mul(transmittance, alpha)
                behind = behind - wp.cw_mul(alpha, share)
                # Where hardly any light is left, there is only rounding error; Adam would make steps of it.
                lit = wp.min(
                    wp.max(constants.STEEP * (transmittance - constants.TRANSMITTANCE_MIN * one), zero), one
                )
                alpha_grad = wp.cw_mul(lit, share - wp.cw_div(behind, wp.max(one - alpha, least)))
                transmittance = transmittance - seen
                if not full:
                    slope = opacity * wp.cw_mul(slope_of(mapping, signed), alpha_grad)
                    if painted:
                        if gradient:
                            slope = wp.cw_mul(slope, paint_columns[slot, 3, x])
                    sum_grad[slot, x] = slope
                red_grad = wp.cw_mul(seen, red)
                green_grad = wp.cw_mul(seen, green)
                blue_grad = wp.cw_mul(seen, blue)
                opacity_grad = wp.cw_mul(own, alpha_grad)
                if painted:
                    if gradient:
                        paint_columns[slot, 0, x] = red_grad
                        paint_columns[slot, 1, x] = green_grad
                        paint_columns[slot, 2, x] = blue_grad
                        paint_columns[slot, 3, x] = opacity * wp.cw_mul(covered, alpha_grad)
                if single_lane:
                    if x > 0:
                        red_grad = red_grad + slot_columns[slot, 0]
                        green_grad = green_grad + slot_columns[slot, 1]
                        blue_grad = blue_grad + slot_columns[slot, 2]
                        opacity_grad = opacity_grad + slot_columns[slot, 3]
                    slot_columns[slot, 0] = red_grad
                    slot_columns[slot, 1] = green_grad
                    slot_columns[slot, 2] = blue_grad
                    slot_columns[slot, 3] = opacity_grad
                else:
                    grad = wp.vec4(total(red_grad), total(green_grad), total(blue_grad), total(opacity_grad))
                    if x > lane * lane_columns:
                        grad = grad + slot_grad[slot, lane]
                    slot_grad[slot, lane] = grad

    return backward
