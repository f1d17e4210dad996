"""The adjoint of compositing for opacities up to 1; see ``composite``.

dL/d alpha_i = T_i (dot(c_i, G) - B_i), where B_i is dot(b_i, G) of the colour b_i that is seen where shape i
and all in front of it are taken away. The other adjoint divides by 1 - alpha_i to find B_i, of which an
opaque shape leaves nothing. Here one walk from the front keeps the transmittance T_i at each slot, and
one from the back, from the background on, has B_{i-1} = B_i + alpha_i (dot(c_i, G) - B_i). The lists go one
opaque shape further back than what is seen (``most`` of ``bins.list_visible``): what is behind it says what
its opacity is worth.
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.composite_backward import slope_of
from warpsplat.kernels.paint.flat import paint_against
from warpsplat.kernels.tile import tile_column, total

wp.set_module_options(constants.MODULE_OPTIONS)

TINY = wp.constant(1.0e-9)


@wp.func
def premultiplied_grads(
    image: wp.array3d[Any],
    hit: wp.array2d[Any],
    image_grad: wp.array3d[Any],
    tile: wp.int32,
    x: wp.int32,
    opaque: Any,
):
    """Return the factor from gradients of straight colours to those of premultiplied ones, and the gradients
    of the opacity and of hit, in a column of pixels whose opacities are ``opaque``.

    Opacities that are no longer divided by, and pixels that are hit throughout, have none.
    """
    one = image.dtype(1.0)
    along = wp.cw_mul(image[tile, 0, x], image_grad[tile, 0, x])
    along = along + wp.cw_mul(image[tile, 1, x], image_grad[tile, 1, x])
    along = along + wp.cw_mul(image[tile, 2, x], image_grad[tile, 2, x])
    touched = hit[tile, x]
    divisor = wp.max(opaque, constants.NOTHING * one)
    above = wp.min(opaque / constants.NOTHING, one)
    opacity_grad = image_grad[tile, 3, x] - wp.cw_mul(wp.cw_div(along, divisor), above)
    partly = wp.min(constants.STEEP * (one - touched), one)
    hit_grad = wp.cw_mul(wp.cw_div(along, wp.max(touched, constants.NOTHING * one)), partly)
    return wp.cw_div(touched, divisor), opacity_grad, hit_grad


@functools.cache
def make_backward(column: Any, *, painted: bool, straight: bool = False) -> wp.Kernel:
    """Return the adjoint for opacities up to 1.

    Args:
        column: type of its vectors of pixels.
        painted: see ``composite.make_forward``.
        straight: whether the colours are straight, see there; then the gradient of hit
            is added to that of each coverage.
    """
    single_lane = column is tile_column
    name = f"{'straight' if straight else 'opaque'}_{'paint_' * painted}backward"

    @wp.kernel(name=name, module="unique", module_options=constants.MODULE_OPTIONS)
    def backward(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # columns of a tile that a thread handles
        tile_range: wp.array[wp.vec2i],  # [tile_count]
        list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
        list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity; negative: see paint_columns
        coverage: wp.array2d[column],  # [slot_capacity, columns]
        mapping: wp.int32,  # how a coverage follows from s: AREA or PRODUCT
        image: wp.array3d[column],  # [tile_count, planes, columns] of the forward pass; straight only
        hit: wp.array2d[column],  # [tile_count, columns] of the forward pass; straight only
        image_grad: wp.array3d[column],  # [tile_count, planes, columns]
        background: wp.vec3,
        # Out:
        transmittances: wp.array2d[column],  # [slot_capacity, lanes] by place in the lists; scratch
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns] replaced by their gradients
        sum_grad: wp.array2d[column],  # [slot_capacity, columns] of visible PARTIAL slots; coverage's memory
        slot_columns: wp.array2d[column],  # [slot_capacity, 4] of colour (3), opacity by pixel row: one lane
        slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes] the same, summed up: several lanes
    ):
        """One thread a tile and lane."""
        i, lane = wp.tid()
        tile = offset + i
        visible = tile_range[tile]
        one = column(1.0)
        zero = column(0.0)
        for x in range(lane * lane_columns, (lane + 1) * lane_columns):
            red = image_grad[tile, 0, x]
            green = image_grad[tile, 1, x]
            blue = image_grad[tile, 2, x]
            if straight:
                opaque = zero
                behind = zero
            else:
                opaque = zero
                if painted:
                    if image_grad.shape[1] == 4:
                        opaque = image_grad[tile, 3, x]
                behind = background[0] * red + background[1] * green + background[2] * blue
            transmittance = one
            for k in range(visible[0], visible[1]):
                transmittances[k, lane] = transmittance
                opacity = list_paint[k][3]
                slot = list_slot[k]
                seen = wp.abs(opacity) * transmittance
                if slot >= 0:
                    seen = wp.cw_mul(seen, wp.abs(coverage[slot, x]))
                if painted:
                    if opacity < 0.0:
                        seen = wp.cw_mul(seen, paint_columns[wp.max(slot, -1 - slot), 3, x])
                transmittance = transmittance - seen
                if straight:
                    opaque = opaque + seen
            if straight:
                factor, opaque, hit_grad = premultiplied_grads(image, hit, image_grad, tile, x, opaque)
                red = wp.cw_mul(red, factor)
                green = wp.cw_mul(green, factor)
                blue = wp.cw_mul(blue, factor)
            for n in range(visible[0], visible[1]):
                k = visible[0] + visible[1] - 1 - n
                paint = list_paint[k]
                slot = list_slot[k]
                full = slot < 0
                signed = one
                if full:
                    slot = -1 - slot
                else:
                    signed = coverage[slot, x]
                covered = wp.abs(signed)
                opacity = wp.abs(paint[3])
                own = covered
                painted_opacity = one
                if painted:
                    gradient = paint[3] < 0.0
                    against = opaque
                    if gradient:
                        painted_opacity = paint_columns[slot, 3, x]
                        against = against + wp.cw_mul(paint_columns[slot, 0, x], red)
                        against = against + wp.cw_mul(paint_columns[slot, 1, x], green)
                        against = against + wp.cw_mul(paint_columns[slot, 2, x], blue)
                    else:
                        against = against + paint_against(paint, red, green, blue)
                    own = wp.cw_mul(covered, painted_opacity)
                else:
                    against = paint_against(paint, red, green, blue)
                    if straight:
                        against = opaque + against
                transmittance = transmittances[k, lane]
                alpha = opacity * own
                difference = against - behind
                alpha_grad = wp.cw_mul(transmittance, difference)
                behind = behind + wp.cw_mul(alpha, difference)
                if not full:
                    if straight:
                        covered_grad = opacity * wp.cw_mul(painted_opacity, alpha_grad)
                        if opacity > constants.SEEN:
                            covered_grad = covered_grad + hit_grad
                        sum_grad[slot, x] = wp.cw_mul(slope_of(mapping, signed), covered_grad)
                    else:
                        slope = slope_of(mapping, signed)
                        if painted:
                            slope = wp.cw_mul(slope, painted_opacity)
                        sum_grad[slot, x] = opacity * wp.cw_mul(slope, alpha_grad)
                seen = wp.cw_mul(transmittance, alpha)
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
