"""Gradients of several pictures that share shapes."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def add_gradients(
    # In:
    offset: wp.int32,
    part: wp.array2d[wp.float32],  # [row_count, size] of a picture of the first shapes alone
    weight: wp.float32,  # what that picture counts
    # Out:
    grad: wp.array2d[wp.float32],  # [row_count or more, size] updated
):
    """Add what the first shapes are worth in a picture of their own, one thread a number."""
    i, j = wp.tid()
    row = offset + i
    grad[row, j] = grad[row, j] + weight * part[row, j]
