"""Flat paint: one colour and one opacity a shape, and the adjoint.

Compositing asks a paint for two products in a column of pixels: its colour times the share of the light that
it reflects, and its colour times the image's gradient. Gradients (``gradient``) are in memory instead, pixel
by pixel.
"""

from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import tile_column, total

wp.set_module_options(constants.MODULE_OPTIONS)

SOME = wp.constant(1.0e-20)  # as good as nothing, but with a sign


@wp.func
def shape_paint(
    paint: wp.array[wp.int32], colors: wp.array[wp.vec3], opacities: wp.array[wp.float32], shape: wp.int32
) -> wp.vec4:
    """Return the colour and opacity of a shape for the tiles' lists; a negative opacity means that the colour
    is a gradient's.
    """
    if paint[shape] != constants.FLAT:
        return wp.vec4(0.0, 0.0, 0.0, -wp.max(opacities[shape], SOME))
    color = colors[shape]
    return wp.vec4(color[0], color[1], color[2], opacities[shape])


@wp.func
def paint_times(paint: wp.vec4, channel: wp.int32, share: Any):
    """Return what a shape adds to a channel of a column of pixels that reflect ``share`` of the light."""
    return paint[channel] * share


@wp.func
def paint_against(paint: wp.vec4, red: Any, green: Any, blue: Any):
    """Return the dot product of the paint's colour with a column's gradient."""
    return paint[0] * red + paint[1] * green + paint[2] * blue


@wp.func
def is_visible(state: wp.int32) -> wp.bool:
    """Return whether a slot in this state has gradients."""
    return state & constants.COVERED != 0 and state & constants.HIDDEN == 0


@wp.kernel(module="unique", module_options=constants.MODULE_OPTIONS)
def flat_backward(
    # In:
    offset: wp.int32,
    paint: wp.array[wp.int32],  # [shape_count]
    slot_range: wp.array[wp.vec2i],  # [shape_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    slot_columns: wp.array2d[tile_column],  # [slot_capacity, 4]
    # Out:
    colors_grad: wp.array[wp.vec3],  # [shape_count] written
    opacities_grad: wp.array[wp.float32],  # [shape_count] written
):
    """Sum over a shape's visible slots in a fixed order, where a tile has one lane: the same bits on every
    run. One thread a shape.
    """
    shape = offset + wp.tid()
    red = tile_column(0.0)
    green = tile_column(0.0)
    blue = tile_column(0.0)
    opacity = tile_column(0.0)
    slots = slot_range[shape]
    for slot in range(slots[0], slots[1]):
        if is_visible(slot_state[slot]):
            red = red + slot_columns[slot, 0]
            green = green + slot_columns[slot, 1]
            blue = blue + slot_columns[slot, 2]
            opacity = opacity + slot_columns[slot, 3]
    if paint[shape] != constants.FLAT:
        red = tile_column(0.0)
        green = tile_column(0.0)
        blue = tile_column(0.0)
    colors_grad[shape] = wp.vec3(total(red), total(green), total(blue))
    opacities_grad[shape] = total(opacity)


@wp.kernel
def sum_slots(
    # In:
    offset: wp.int32,
    slot_range: wp.array[wp.vec2i],  # [shape_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes]
    # Out:
    lane_grad: wp.array2d[wp.vec4],  # [shape_count, lanes]
):
    """Sum over a shape's visible slots in a fixed order, where a tile has several lanes. One thread a shape
    and lane: a thread a shape would wait for thousands of loads, one after the other.
    """
    i, lane = wp.tid()
    shape = offset + i
    sums = wp.vec4(0.0, 0.0, 0.0, 0.0)
    slots = slot_range[shape]
    for slot in range(slots[0], slots[1]):
        if is_visible(slot_state[slot]):
            sums = sums + slot_grad[slot, lane]
    lane_grad[shape, lane] = sums


@wp.kernel
def sum_lanes(
    # In:
    offset: wp.int32,
    paint: wp.array[wp.int32],  # [shape_count]
    lane_grad: wp.array2d[wp.vec4],  # [shape_count, lanes]
    # Out:
    colors_grad: wp.array[wp.vec3],  # [shape_count] written
    opacities_grad: wp.array[wp.float32],  # [shape_count] written
):
    """Sum over a shape's lanes. One thread a shape."""
    shape = offset + wp.tid()
    sums = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for lane in range(lane_grad.shape[1]):
        sums = sums + lane_grad[shape, lane]
    opacities_grad[shape] = sums[3]
    if paint[shape] != constants.FLAT:
        sums = wp.vec4(0.0, 0.0, 0.0, 0.0)
    colors_grad[shape] = wp.vec3(sums[0], sums[1], sums[2])
