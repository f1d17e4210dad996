"""Loss of an image with opacity, with its gradient: squared error on black and on white."""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import total

wp.set_module_options(constants.MODULE_OPTIONS)

OPTIONS = {**constants.MODULE_OPTIONS, "max_unroll": 1}
"""Unrolled, the loop over channels takes a minute to compile for CUDA."""


@functools.cache
def make_alpha_loss(column: Any) -> wp.Kernel:
    """Return the loss of an image with opacity, for vectors of type ``column``."""

    @wp.kernel(name="alpha_loss", module="unique", module_options=OPTIONS)
    def alpha_loss(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # columns of a tile that a thread handles
        image: wp.array3d[column],  # [tile_count, 4, columns] premultiplied, and opacity
        target: wp.array3d[column],  # [tile_count, 4, columns]
        importance: wp.array2d[column],  # [tile_count, columns] weight of a pixel, 0 outside of the image
        tile_cache: wp.array[wp.int32],  # [tile_count] the loss of CACHED tiles is kept, if it is known
        value_count: wp.int32,  # pixels x colours
        # Out:
        image_grad: wp.array3d[column],  # [tile_count, 4, columns]
        loss: wp.array3d[wp.float32],  # [tile_count, 3, lanes] sums of squares; below 0: not known
    ):
        """Mean over pixels and colours of w (e^2 + (e - a)^2) / 2: e is the error of the premultiplied
        colour, which is that on black, a the error of the opacity, by which less of the white shows. One
        thread a tile and lane.
        """
        i, lane = wp.tid()
        tile = offset + i
        if tile_cache[tile] == constants.CACHED and loss[tile, 0, lane] >= 0.0:
            return
        factor = 1.0 / float(value_count)
        for channel in range(3):
            squares = column(0.0)
            for x in range(lane * lane_columns, (lane + 1) * lane_columns):
                e = image[tile, channel, x] - target[tile, channel, x]
                white = e - (image[tile, 3, x] - target[tile, 3, x])
                weight = importance[tile, x]
                inside = wp.min(1.0e30 * weight, column(1.0))
                squares = squares + 0.5 * wp.cw_mul(inside, wp.cw_mul(e, e) + wp.cw_mul(white, white))
                image_grad[tile, channel, x] = factor * wp.cw_mul(weight, e + white)
                opaque = factor * wp.cw_mul(weight, white)
                if channel == 0:
                    image_grad[tile, 3, x] = -opaque
                else:
                    image_grad[tile, 3, x] = image_grad[tile, 3, x] - opaque
            loss[tile, channel, lane] = total(squares)

    return alpha_loss
