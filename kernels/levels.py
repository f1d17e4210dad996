"""Gradients of several images that share shapes."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def add_gradients(
    # In:
    offset: wp.int32,
    part: wp.array2d[wp.float32],  # [row_count, size] of an image of the first shapes alone
    weight: wp.float32,  # weight of that image
    # Out:
    grad: wp.array2d[wp.float32],  # [row_count or more, size] updated
):
    """Add the weighted gradients of an image of the first shapes alone. One thread a number."""
    i, j = wp.tid()
    row = offset + i
    grad[row, j] = grad[row, j] + weight * part[row, j]
