"""Flat paint: one colour and one opacity a shape, and the adjoint.

Compositing asks a paint for two things of a column of pixels: a light times the paint's colour, and the
colour times the image's gradient. Gradients (``gradient``) lie in memory instead, pixel by pixel.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

SOME = wp.constant(1.0e-20)  # as good as nothing, but with a sign


@wp.func
def shape_paint(
    paint: wp.array[wp.int32], colors: wp.array[wp.vec3], opacities: wp.array[wp.float32], shape: wp.int32
) -> wp.vec4:
    """Colour and opacity of a shape, as the tiles' lists have them; a negative opacity says that the colour
    is a gradient's.
    """
    if paint[shape] != constants.FLAT:
        return wp.vec4(0.0, 0.0, 0.0, -wp.max(opacities[shape], SOME))
    color = colors[shape]
    return wp.vec4(color[0], color[1], color[2], opacities[shape])


@wp.func
def paint_times(paint: wp.vec4, channel: wp.int32, light: column) -> column:
    """What a column of pixels gets in a channel where ``light`` falls on the shape."""
    return paint[channel] * light


@wp.func
def paint_against(paint: wp.vec4, red: column, green: column, blue: column) -> column:
    """Dot product of the paint's colour with a column's gradient."""
    return paint[0] * red + paint[1] * green + paint[2] * blue


@wp.kernel
def flat_backward(
    # In:
    offset: wp.int32,
    lanes: wp.int32,
    paint: wp.array[wp.int32],  # [shape_count]
    slot_first: wp.array[wp.int32],  # [shape_count]
    slot_last: wp.array[wp.int32],  # [shape_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    slot_columns: wp.array2d[column],  # [slot_capacity, 4]
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes]
    # Out:
    colors_grad: wp.array[wp.vec3],  # [shape_count] written
    opacities_grad: wp.array[wp.float32],  # [shape_count] written
):
    """One thread a shape sums its visible slots in a fixed order: the same bits on every run."""
    shape = offset + wp.tid()
    red = column(0.0)
    green = column(0.0)
    blue = column(0.0)
    opacity = column(0.0)
    sums = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for slot in range(slot_first[shape], slot_last[shape]):
        state = slot_state[slot]
        if state & constants.COVERED != 0 and state & constants.HIDDEN == 0:
            if lanes == 1:
                red = red + slot_columns[slot, 0]
                green = green + slot_columns[slot, 1]
                blue = blue + slot_columns[slot, 2]
                opacity = opacity + slot_columns[slot, 3]
            else:
                for lane in range(lanes):
                    sums = sums + slot_grad[slot, lane]
    if paint[shape] != constants.FLAT:
        red = column(0.0)
        green = column(0.0)
        blue = column(0.0)
        sums = wp.vec4(0.0, 0.0, 0.0, sums[3])
    colors_grad[shape] = wp.vec3(sums[0] + total(red), sums[1] + total(green), sums[2] + total(blue))
    opacities_grad[shape] = sums[3] + total(opacity)
