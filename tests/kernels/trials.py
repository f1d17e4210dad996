"""Kernels that map numbers by elementary functions."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.elementary import angle_of, power, sine_and_cosine

wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers


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
