"""Coverage -> image by front-to-back alpha blending (paper eq. 8, once per shape), and kernels like it.

alpha = opacity x coverage; C = sum_i c_i alpha_i prod_{j<i} (1 - alpha_j) + background x transmittance, where
the transmittance T_i = prod_{j<i} (1 - alpha_j) is the part of the light that reaches shape i. Coverage may
come from splats or any other model: this stage knows only the tiles' lists of visible slots. It takes the
magnitude (an exact fill stores its orientation as a sign), and 1 throughout a FULL slot. A flat paint comes
with the lists, as colour and opacity; where that opacity is negative, the colours and opacities of the slot's
pixels are in ``paint_columns``. On a transparent canvas the fourth plane is the opacity of each pixel, which
is treated as a colour channel in which all shapes are 1 and the background is 0.

The factories here, in ``composite_backward`` and in ``composite_opaque`` capture booleans; Warp drops the
branches not taken. Those of the first two make kernels when they are needed, which takes milliseconds each.
Scenes of flat paints on an opaque background have kernels of their own because the tests for other paints,
made for each slot, cost a tenth of the time.
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.flat import paint_times
from warpsplat.kernels.tile import total

wp.set_module_options(constants.MODULE_OPTIONS)

TINY = wp.constant(1.0e-9)


@functools.cache
def make_forward(column: Any, *, painted: bool, straight: bool = False) -> wp.Kernel:
    """Return a kernel that composites each tile's list.

    Args:
        column: type of its vectors of pixels.
        painted: whether there may be gradients and pictures, or a transparent canvas; if ``straight``, where
            all canvases are transparent, whether there may be gradients and pictures.
        straight: whether the colours are to be straight, not premultiplied, as in DiffVG: the mean over the
            pixel's area of the colours, black where nothing is. That is colour / opacity x hit; hit, the part
            of the pixel that shapes lie on, is the sum of their coverages, at most 1, which compositing
            underestimates where shapes meet.
    """
    skips_cached = not straight
    transparent = painted or straight
    name = f"{'straight_' * straight}{'paint_' * painted}forward" if transparent else "composite_forward"

    @wp.kernel(name=name, module="unique", module_options=constants.MODULE_OPTIONS)
    def forward(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # columns of a tile that a thread handles
        tile_range: wp.array[wp.vec2i],  # [tile_count]
        tile_cache: wp.array[wp.int32],  # [tile_count]
        list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
        list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity; negative: see paint_columns
        coverage: wp.array2d[column],  # [slot_capacity, columns]
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns] colour and opacity of each pixel
        background: wp.vec3,
        # Out:
        image: wp.array3d[column],  # [tile_count, planes, columns] colour, and opacity if transparent
        hit: wp.array2d[column],  # [tile_count, columns] part of a pixel that shapes lie on; straight only
    ):
        """One thread a tile and lane. Cached tiles stay as they are."""
        i, lane = wp.tid()
        tile = offset + i
        if skips_cached:
            if tile_cache[tile] == constants.CACHED:
                return
        visible = tile_range[tile]
        for x in range(lane * lane_columns, (lane + 1) * lane_columns):
            transmittance = column(1.0)
            red = column(0.0)
            green = column(0.0)
            blue = column(0.0)
            if straight:
                touched = column(0.0)
                seen = column(0.0)
            for k in range(visible[0], visible[1]):
                paint = list_paint[k]
                slot = list_slot[k]
                if straight:
                    opacity = wp.abs(paint[3])
                    covered = column(1.0)
                    if slot >= 0:
                        covered = wp.abs(coverage[slot, x])
                    if opacity > constants.SEEN:
                        touched = touched + covered
                    share = opacity * wp.cw_mul(covered, transmittance)
                else:
                    share = wp.abs(paint[3]) * transmittance
                    if slot >= 0:
                        share = wp.cw_mul(share, wp.abs(coverage[slot, x]))
                if painted:
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
                else:
                    red = red + paint_times(paint, 0, share)
                    green = green + paint_times(paint, 1, share)
                    blue = blue + paint_times(paint, 2, share)
                transmittance = transmittance - share
                if straight:
                    seen = seen + share
            if straight:
                one = column(1.0)
                touched = wp.min(touched, one)
                factor = wp.cw_div(touched, wp.max(seen, constants.NOTHING * one))
                image[tile, 0, x] = wp.cw_mul(red, factor)
                image[tile, 1, x] = wp.cw_mul(green, factor)
                image[tile, 2, x] = wp.cw_mul(blue, factor)
                hit[tile, x] = touched
            else:
                image[tile, 0, x] = red + background[0] * transmittance
                image[tile, 1, x] = green + background[1] * transmittance
                image[tile, 2, x] = blue + background[2] * transmittance
            if transparent:
                if image.shape[1] == 4:
                    image[tile, 3, x] = column(1.0) - transmittance

    return forward


@functools.cache
def make_removal_cost(column: Any) -> wp.Kernel:
    """Return a kernel that computes what removing a shape costs, for vectors of type ``column``."""

    @wp.kernel(name="removal_cost", module="unique", module_options=constants.MODULE_OPTIONS)
    def removal_cost(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,
        tile_range: wp.array[wp.vec2i],  # [tile_count]
        list_slot: wp.array[wp.int32],  # [slot_capacity]
        list_paint: wp.array[wp.vec4],  # [slot_capacity]
        coverage: wp.array2d[column],  # [slot_capacity, columns]
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns]
        image: wp.array3d[column],  # [tile_count, planes, columns] of the forward pass
        target: wp.array3d[column],  # [tile_count, planes, columns]
        importance: wp.array2d[column],  # [tile_count, columns] weight of a pixel, 0 outside of the image
        # Out:
        slot_cost: wp.array2d[wp.float32],  # [slot_capacity, lanes] sum over pixels and channels; others kept
    ):
        """Compute by how much the weighted squared error would grow if one shape were removed.

        Behind a shape lies the colour b = rest / T; without it a pixel changes by d = T alpha (b - c), and
        its squared error by 2 d . (image - target) + d . d. On a transparent canvas the error is the mean of
        those on black and on white, where what is not covered is white.
        """
        i, lane = wp.tid()
        tile = offset + i
        visible = tile_range[tile]
        one = column(1.0)
        zero = column(0.0)
        planes = image.shape[1]
        for x in range(lane * lane_columns, (lane + 1) * lane_columns):
            transmittance = one
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
            for k in range(visible[0], visible[1]):
                paint = list_paint[k]
                slot = list_slot[k]
                seen = wp.abs(paint[3]) * transmittance
                if slot >= 0:
                    seen = wp.cw_mul(seen, wp.abs(coverage[slot, x]))
                else:
                    slot = -1 - slot
                if paint[3] < 0.0:
                    seen = wp.cw_mul(seen, paint_columns[slot, 3, x])
                lit = wp.min(
                    wp.max(constants.STEEP * (transmittance - constants.TRANSMITTANCE_MIN * one), zero), one
                )
                transmittance = transmittance - seen
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
                share = wp.cw_div(seen, wp.max(transmittance, TINY * one))
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

    return removal_cost


@functools.cache
def make_visibility(column: Any) -> wp.Kernel:
    """Return a kernel that computes what is visible of shapes, for vectors of type ``column``."""

    @wp.kernel(name="visibility", module="unique", module_options=constants.MODULE_OPTIONS)
    def visibility(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # columns of a tile that a thread handles
        tile_range: wp.array[wp.vec2i],  # [tile_count]
        list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
        list_paint: wp.array[wp.vec4],  # [slot_capacity] opacity last, negative of gradients
        coverage: wp.array2d[column],  # [slot_capacity, columns]
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns] of gradients: opacity last
        # Out:
        seen: wp.array2d[column],  # [slot_capacity, columns] written for slots on the lists; others kept
    ):
        """Compute opacity x coverage x transmittance pixel by pixel: the image changes by seen x d where a
        shape's colour changes by d. One thread a tile and lane.
        """
        i, lane = wp.tid()
        tile = offset + i
        visible = tile_range[tile]
        for x in range(lane * lane_columns, (lane + 1) * lane_columns):
            transmittance = column(1.0)
            for k in range(visible[0], visible[1]):
                opacity = list_paint[k][3]
                slot = list_slot[k]
                share = wp.abs(opacity) * transmittance
                if slot >= 0:
                    share = wp.cw_mul(share, wp.abs(coverage[slot, x]))
                else:
                    slot = -1 - slot
                if opacity < 0.0:
                    share = wp.cw_mul(share, paint_columns[slot, 3, x])
                seen[slot, x] = share
                transmittance = transmittance - share

    return visibility
