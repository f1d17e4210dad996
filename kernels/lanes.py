"""Sums over the lanes of a tile, before the host reads them."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def lane_sums(
    # In:
    offset: wp.int32,
    by_lane: wp.array2d[wp.float32],  # [n, lanes]
    # Out:
    sums: wp.array[wp.float32],  # [n]
):
    """Sum up in the order of the lanes. One thread a row."""
    i = offset + wp.tid()
    total = float(0.0)
    for lane in range(by_lane.shape[1]):
        total += by_lane[i, lane]
    sums[i] = total
