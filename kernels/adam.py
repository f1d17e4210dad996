"""Adam (Kingma and Ba 2015) with a learning rate per parameter group and an age per curve."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

BETA1 = wp.constant(0.9)
BETA2 = wp.constant(0.99)
EPSILON = wp.constant(1.0e-12)  # the gradients of a mean over 10^6 pixels are about 1e-7
PI = wp.constant(3.141592653589793)


@wp.kernel
def advance(
    # In:
    first: wp.int32,
    # Out:
    ages: wp.array[wp.int32],  # [curve_count] steps since the curve was placed, this one included
    clock: wp.array[wp.int32],  # [1] steps since the start, this one included
):
    """Count the step, on the device, so that a captured graph can be replayed unchanged."""
    i = first + wp.tid()
    ages[i] = ages[i] + 1
    if i == 0:
        clock[0] = clock[0] + 1


@wp.kernel
def adam_update(
    # In:
    first: wp.int32,
    grad: wp.array2d[wp.float32],  # [curve_count, value_count]
    ages: wp.array[wp.int32],  # [curve_count]
    clock: wp.array[wp.int32],  # [1]
    step_count: wp.int32,  # length of the decay
    rate: wp.float32,  # learning rate at the start, in the parameter's unit
    final: wp.float32,  # fraction of it at the end
    low: wp.float32,  # bounds, kept by projection
    high: wp.float32,
    # Out:
    value: wp.array2d[wp.float32],  # [curve_count, value_count] updated
    moment1: wp.array2d[wp.float32],  # [curve_count, value_count] updated
    moment2: wp.array2d[wp.float32],  # [curve_count, value_count] updated
):
    """Cosine decay by the clock; bias correction by the curve's own age, so that a curve placed late starts
    as one placed at the start did.
    """
    i, j = wp.tid()
    curve = first + i
    progress = wp.min(float(clock[0]) / float(step_count), 1.0)
    current = rate * (final + (1.0 - final) * 0.5 * (1.0 + wp.cos(PI * progress)))
    age = float(ages[curve])
    g = grad[curve, j]
    # A gradient that is not finite must not poison the moments.
    if not wp.isfinite(g):
        g = 0.0
    m1 = BETA1 * moment1[curve, j] + (1.0 - BETA1) * g
    m2 = BETA2 * moment2[curve, j] + (1.0 - BETA2) * g * g
    moment1[curve, j] = m1
    moment2[curve, j] = m2
    m1_hat = m1 / (1.0 - wp.pow(BETA1, age))
    m2_hat = m2 / (1.0 - wp.pow(BETA2, age))
    value[curve, j] = wp.clamp(value[curve, j] - current * m1_hat / (wp.sqrt(m2_hat) + EPSILON), low, high)
