"""Kernels for tests: two losses (``tests/fit/test_new_loss.py``), elementary functions."""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.elementary import angle_of, power, sine_and_cosine

wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers


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
