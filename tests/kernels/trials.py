"""Kernels of the trials: a coverage (``tests/rendering/test_new_coverage.py``), two losses
(``tests/fit/test_new_loss.py``), an attribute (``tests/scene/test_new_attribute.py``), elementary functions
(``test_elementary.py``).
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.elementary import angle_of, power, sine_and_cosine

wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers

TILE = wp.constant(constants.TILE)
PARTIAL = wp.constant(constants.PARTIAL)


@wp.kernel
def corners(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    scale: wp.float32,
    # Out:
    corner_first: wp.array[wp.int32],  # [shape_count]
    corner_last: wp.array[wp.int32],  # [shape_count]
    corner: wp.array[wp.vec2],  # [2 x shape_count] px; least, largest
):
    shape = offset + wp.tid()
    low = points[point_first[shape]]
    high = low
    for i in range(point_first[shape], point_first[shape + 1]):
        low = wp.min(low, points[i])
        high = wp.max(high, points[i])
    corner_first[shape] = 2 * shape
    corner_last[shape] = 2 * shape + 2
    corner[2 * shape] = scale * low
    corner[2 * shape + 1] = scale * high


@wp.func
def overlap(low: wp.float32, high: wp.float32, pixel: wp.float32) -> wp.float32:
    """Length of [low, high] in [pixel, pixel + 1]."""
    return wp.max(wp.min(high, pixel + 1.0) - wp.max(low, pixel), 0.0)


@wp.kernel
def boxes_forward(
    # In:
    offset: wp.int32,
    slot_shape: wp.array[wp.int32],  # [slot_capacity]
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    corner: wp.array[wp.vec2],  # [2 x shape_count]
    tiles_x: wp.int32,
    # Out:
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    coverage_pixels: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
):
    slot = offset + wp.tid()
    shape = slot_shape[slot]
    if shape < 0:
        return
    slot_state[slot] = PARTIAL
    low = corner[2 * shape]
    high = corner[2 * shape + 1]
    left = TILE * (slot_tile[slot] % tiles_x)
    top = TILE * (slot_tile[slot] / tiles_x)
    for x in range(TILE):
        across = overlap(low[0], high[0], float(left + x))
        for y in range(TILE):
            coverage_pixels[slot, TILE * x + y] = across * overlap(low[1], high[1], float(top + y))


@wp.func
def holds(edge: wp.float32, pixel: wp.float32) -> wp.float32:
    """1 where ``edge`` lies in the pixel, the slope of its overlap, else 0."""
    if edge > pixel and edge < pixel + 1.0:
        return 1.0
    return 0.0


@wp.kernel
def boxes_backward(
    # In:
    offset: wp.int32,
    slot_first: wp.array[wp.int32],  # [shape_count]
    slot_last: wp.array[wp.int32],  # [shape_count]
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    corner: wp.array[wp.vec2],  # [2 x shape_count]
    sum_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    tiles_x: wp.int32,
    points: wp.array[wp.vec2],  # [point_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    scale: wp.float32,
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count]
):
    """The sides' gradients go to the points that they touch."""
    shape = offset + wp.tid()
    low = corner[2 * shape]
    high = corner[2 * shape + 1]
    low_grad = wp.vec2(0.0, 0.0)
    high_grad = wp.vec2(0.0, 0.0)
    for slot in range(slot_first[shape], slot_last[shape]):
        left = TILE * (slot_tile[slot] % tiles_x)
        top = TILE * (slot_tile[slot] / tiles_x)
        for i in range(TILE * TILE):
            x = float(left + i / TILE)
            y = float(top + i % TILE)
            by_x = sum_grad[slot, i] * overlap(low[1], high[1], y)
            by_y = sum_grad[slot, i] * overlap(low[0], high[0], x)
            low_grad -= wp.vec2(by_x * holds(low[0], x), by_y * holds(low[1], y))
            high_grad += wp.vec2(by_x * holds(high[0], x), by_y * holds(high[1], y))
    for i in range(point_first[shape], point_first[shape + 1]):
        gradient = wp.vec2(0.0, 0.0)
        for axis in range(2):
            if scale * points[i][axis] == low[axis]:
                gradient[axis] = gradient[axis] + scale * low_grad[axis]
            if scale * points[i][axis] == high[axis]:
                gradient[axis] = gradient[axis] + scale * high_grad[axis]
        points_grad[i] = gradient


@functools.cache
def make_blue_backward(column: Any) -> wp.Kernel:
    """Return the adjoint of the mean of blue, for vectors of type ``column``."""

    @wp.kernel(name="blue_backward", module="unique", module_options=constants.MODULE_OPTIONS)
    def blue_backward(
        # In:
        offset: wp.int32,
        inside: wp.array2d[column],  # [tile_count, columns]
        value_count: wp.int32,  # pixels x channels
        weight: wp.float32,
        # Out:
        image_grad: wp.array3d[column],  # [tile_count, 3, columns] added to
    ):
        """Add the gradient of ``weight`` x (1 - the mean of blue)."""
        tile = offset + wp.tid()
        for x in range(inside.shape[1]):
            image_grad[tile, 2, x] = image_grad[tile, 2, x] - weight / float(value_count) * inside[tile, x]

    return blue_backward


@wp.kernel
def thin_backward(
    # In:
    offset: wp.int32,
    weight: wp.float32,
    # Out:
    opacities_grad: wp.array[wp.float32],  # [shape_count] added to
):
    """Add the gradient of ``weight`` x the sum of the opacities."""
    shape = offset + wp.tid()
    opacities_grad[shape] = opacities_grad[shape] + weight


@wp.kernel
def glow_backward(
    # In:
    offset: wp.int32,
    glows: wp.array[wp.vec3],  # [shape_count]
    aim: wp.vec3,
    # Out:
    glows_grad: wp.array[wp.vec3],  # [shape_count] written
):
    shape = offset + wp.tid()
    glows_grad[shape] = glows[shape] - aim


@wp.kernel
def sines_and_cosines(x: wp.array[wp.float32], out: wp.array[wp.vec2]):
    i = wp.tid()
    out[i] = sine_and_cosine(x[i])


@wp.kernel
def angles_of_directions(x: wp.array[wp.float32], out: wp.array[wp.float32]):
    i = wp.tid()
    direction = sine_and_cosine(x[i])
    out[i] = angle_of(direction[1], direction[0])


@wp.kernel
def angles(x: wp.array[wp.float32], y: wp.array[wp.float32], out: wp.array[wp.float32]):
    i = wp.tid()
    out[i] = angle_of(x[i], y[i])


@wp.kernel
def powers(x: wp.array[wp.int32], out: wp.array[wp.float32]):
    i = wp.tid()
    out[i] = power(0.999, x[i])
