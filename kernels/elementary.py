"""Elementary functions of kernels, with the same bits on every processor.

Those of Warp are the C library's on a CPU, which chooses its code by the processor, and CUDA's on a GPU.
These are made of products, sums, quotients and square roots alone, good to a few units in the last place.
"""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

PI = wp.constant(3.141592653589793)
HALF_PI = wp.constant(1.5707963267948966)
TWO_OVER_PI = wp.constant(0.6366197723675814)
HALF_PI_HIGH = wp.constant(1.5703125)
HALF_PI_LOW = wp.constant(4.838267948966e-4)
"""Half of pi as a sum: products of the first part with whole numbers up to 2^15 are exact."""

TAN_EIGHTH = wp.constant(0.41421356237309503)  # of pi
TAN_SIXTEENTH = wp.constant(0.19891236737965800)
TAN_THREE_SIXTEENTHS = wp.constant(0.66817863791929890)


@wp.func
def power(base: wp.float32, exponent: wp.int32) -> wp.float32:
    """``base`` to a whole power of at least 0."""
    result = wp.float64(1.0)
    square = wp.float64(base)
    left = exponent
    while left > 0:
        if left % 2 == 1:
            result *= square
        square *= square
        left = left // 2
    return wp.float32(result)


@wp.func
def sine_and_cosine(angle: wp.float32) -> wp.vec2:
    """(sine, cosine) of an angle [radians, up to 10^4]."""
    turns = wp.rint(angle * TWO_OVER_PI)  # whole quarter turns
    x = (angle - turns * HALF_PI_HIGH) - turns * HALF_PI_LOW
    z = x * x
    s = x + x * z * (-1.6666667e-1 + z * (8.3333333e-3 + z * (-1.9841270e-4 + z * 2.7557319e-6)))
    c = 1.0 - 0.5 * z + z * z * (4.1666667e-2 + z * (-1.3888889e-3 + z * (2.4801587e-5 + z * -2.7557319e-7)))
    quarter = int(turns) & 3
    if quarter == 1:
        return wp.vec2(c, -s)
    if quarter == 2:
        return wp.vec2(-s, -c)
    if quarter == 3:
        return wp.vec2(-c, s)
    return wp.vec2(s, c)


@wp.func
def angle_of(x: wp.float32, y: wp.float32) -> wp.float32:
    """Angle [radians] of the vector (x, y), from -pi to pi; 0 of none."""
    short = wp.min(wp.abs(x), wp.abs(y))
    long = wp.max(wp.abs(x), wp.abs(y))
    if long == 0.0:
        return 0.0
    ratio = short / long
    centre = float(0.0)
    angle = float(0.0)
    if ratio > TAN_THREE_SIXTEENTHS:
        centre = 1.0
        angle = 0.5 * HALF_PI
    elif ratio > TAN_SIXTEENTH:
        centre = TAN_EIGHTH
        angle = 0.25 * HALF_PI
    t = (ratio - centre) / (1.0 + ratio * centre)
    z = t * t
    angle += t + t * z * (-3.3333333e-1 + z * (2.0e-1 + z * (-1.4285714e-1 + z * 1.1111111e-1)))
    if wp.abs(y) > wp.abs(x):
        angle = HALF_PI - angle
    if x < 0.0:
        angle = PI - angle
    if y < 0.0:
        angle = -angle
    return angle
