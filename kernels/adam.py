"""Adam (Kingma and Ba 2015) with a learning rate per attribute and an age per shape."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.elementary import PI, power, sine_and_cosine

wp.set_module_options(constants.MODULE_OPTIONS)

EPSILON = wp.constant(1.0e-12)  # the gradients of a mean over 10^6 pixels are about 1e-7


@wp.kernel
def advance(
    # In:
    offset: wp.int32,
    step_count: wp.int32,  # length of the decay
    final: wp.float32,  # fraction of the learning rates at the end
    beta1: wp.float32,  # shares of the moments that a step keeps; if they are equal, no step exceeds its rate
    beta2: wp.float32,
    # Out:
    ages: wp.array[wp.int32],  # [shape_count] steps since the shape was placed, this one included
    clock: wp.array[wp.int32],  # [1] steps since the start, this one included
    biases: wp.array[wp.vec2],  # [shape_count] bias correction of the two moments at that age
    decay: wp.array[wp.float32],  # [1] fraction of the learning rates at this step
):
    """Count the step, on the device, so that a captured graph can be replayed unchanged.

    The rates decay along a cosine. Biases go by the shape's own age: a shape placed late starts as one
    placed at the start did.
    """
    i = offset + wp.tid()
    ages[i] = ages[i] + 1
    biases[i] = wp.vec2(1.0 - power(beta1, ages[i]), 1.0 - power(beta2, ages[i]))
    if i == 0:
        clock[0] = clock[0] + 1
        progress = wp.min(float(clock[0]) / float(step_count), 1.0)
        decay[0] = final + (1.0 - final) * 0.5 * (1.0 + sine_and_cosine(PI * progress)[1])


@wp.kernel
def tie_twins(
    # In:
    offset: wp.int32,
    point_twin: wp.array[wp.int32],  # [point_count] the same point of the shape behind, or NONE
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] updated
):
    """Give two rows that are one point their total gradient, so that they move as one."""
    i = offset + wp.tid()
    j = point_twin[i]
    if j != constants.NONE:
        both = points_grad[i] + points_grad[j]
        points_grad[i] = both
        points_grad[j] = both


@wp.kernel
def adam_update(
    # In:
    offset: wp.int32,
    grad: wp.array2d[wp.float32],  # [row_count, size]
    owner: wp.array[wp.int32],  # [row_count] the shape of each row
    held: wp.array[wp.int32],  # [row_count] 1: stays as it is
    kind: wp.array[wp.int32],  # [shape_count]
    kinds: wp.int32,  # the kinds that have the attribute, a bit each
    paint: wp.array[wp.int32],  # [shape_count]
    paints: wp.int32,  # the paints that have it, a bit each
    biases: wp.array[wp.vec2],  # [shape_count]
    decay: wp.array[wp.float32],  # [1]
    beta1: wp.float32,  # as in ``advance``
    beta2: wp.float32,
    rate: wp.float32,  # learning rate at the start, in the attribute's unit
    low: wp.float32,  # bounds
    high: wp.float32,
    # Out:
    value: wp.array2d[wp.float32],  # [row_count, size] updated
    moment1: wp.array2d[wp.float32],  # [row_count, size] updated
    moment2: wp.array2d[wp.float32],  # [row_count, size] updated
    broken: wp.array[wp.int32],  # [shape_count] 1 where a number was not finite; every writer writes the same
):
    """Make a step of Adam, with bounds kept by projection. One thread a number.

    Where the gradient, the moments or the value are not finite nothing is updated, so that they stay as they
    are for ``fit.densification`` to find.
    """
    i, j = wp.tid()
    row = offset + i
    shape = owner[row]
    if (kinds >> kind[shape]) & (paints >> paint[shape]) & 1 == 0 or held[row] != 0:
        return
    current = rate * decay[0]
    g = grad[row, j]
    m1 = beta1 * moment1[row, j] + (1.0 - beta1) * g
    m2 = beta2 * moment2[row, j] + (1.0 - beta2) * g * g
    m1_hat = m1 / biases[shape][0]
    m2_hat = m2 / biases[shape][1]
    new = value[row, j] - current * m1_hat / (wp.sqrt(m2_hat) + EPSILON)
    # Any number that is not finite makes one of these so: moment2 alone, infinite, would make the update 0.
    if not (wp.isfinite(new) and wp.isfinite(m2)):
        broken[shape] = 1
        return
    moment1[row, j] = m1
    moment2[row, j] = m2
    value[row, j] = wp.clamp(new, low, high)
