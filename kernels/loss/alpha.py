"""Loss of an image with opacity, with its gradient: squared error on black and on white."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import column, total

# Unrolled, its loops over channels and columns take a minute to compile for CUDA.
wp.set_module_options({**constants.MODULE_OPTIONS, "max_unroll": 1})


@wp.kernel
def alpha_loss(
    # In:
    offset: wp.int32,
    image: wp.array3d[column],  # [tile_count, 4, TILE] premultiplied, and opacity
    target: wp.array3d[column],  # [tile_count, 4, TILE]
    importance: wp.array2d[column],  # [tile_count, TILE] weight of a pixel, 0 outside of the image
    tile_cache: wp.array[wp.int32],  # [tile_count] the loss of CACHED tiles is kept, if it is known
    value_count: wp.int32,  # pixels x colours
    # Out:
    image_grad: wp.array3d[column],  # [tile_count, 4, TILE]
    loss: wp.array2d[wp.float32],  # [tile_count, 3] sums of squares, unweighted; below 0: not known
):
    """Mean over pixels and colours of w (e^2 + (e - a)^2) / 2: e is the error of the premultiplied colour,
    which is that on black, a the error of the opacity, by which less of the white shows. One thread a tile.
    """
    tile = offset + wp.tid()
    if tile_cache[tile] == constants.CACHED and loss[tile, 0] >= 0.0:
        return
    factor = 1.0 / float(value_count)
    for channel in range(3):
        squares = column(0.0)
        for x in range(constants.TILE):
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
        loss[tile, channel] = total(squares)
