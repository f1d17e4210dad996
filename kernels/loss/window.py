"""Loss of the image with its gradient, for threads that have only a few pixels: each sums up the window that
they lie in by itself, from pixels that its neighbours read as well. See ``image``, which has the formulas.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.loss.image import C1, C2, WINDOW
from warpsplat.kernels.tile import quad, total

wp.set_module_options(constants.MODULE_OPTIONS)

QUAD = wp.constant(constants.QUAD)
PARTS = wp.constant(constants.TILE // constants.QUAD)  # of a tile's column, a quad each


@wp.func
def window_around(i: wp.int32, shift: wp.int32, size: wp.int32) -> wp.vec2i:
    """Return the first pixel of the window that pixel ``i`` of a tile lies in, and one past the last."""
    first = (i + shift) / WINDOW * WINDOW - shift
    return wp.vec2i(wp.max(first, 0), wp.min(first + WINDOW, size))


@wp.func
def rows_inside(count: wp.int32) -> quad:
    """Return 1 in the first ``count`` rows, 0 in the others."""
    result = quad(0.0)
    for i in range(QUAD):
        result[i] = wp.where(i < count, 1.0, 0.0)
    return result


@wp.kernel
def window_loss(
    # In:
    offset: wp.int32,
    image: wp.array3d[quad],  # [tile_count, 3, lanes]
    target: wp.array3d[quad],  # [tile_count, 3, lanes]
    importance: wp.array2d[quad],  # [tile_count, lanes] weight of a pixel, 0 outside of the image
    tile_cache: wp.array[wp.int32],  # [tile_count] the loss of CACHED tiles is kept, if it is known
    weighted: wp.int32,  # whether that is anything but 1 in the image; if not, it is not read
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    clock: wp.array[wp.int32],  # [1] steps so far
    similarity_weight: wp.float32,
    value_count: wp.int32,  # pixels x channels
    # Out:
    image_grad: wp.array3d[quad],  # [tile_count, 3, lanes]
    loss: wp.array3d[wp.float32],  # [tile_count, 3, lanes] sums of squares; below 0: not known
    similarity: wp.array3d[wp.float32],  # [tile_count, 3, lanes] sums of SSIM x weight
):
    """One thread a tile, channel and quad. A quad lies in one window, whose borders are multiples of QUAD."""
    i, channel, own = wp.tid()
    tile = offset + i
    if tile_cache[tile] == constants.CACHED and loss[tile, channel, own] >= 0.0:
        return
    x = own / PARTS
    y = QUAD * (own % PARTS)
    columns = wp.min(width - tile % tiles_x * constants.TILE, constants.TILE)
    rows = wp.min(height - tile / tiles_x * constants.TILE, constants.TILE)
    u = image[tile, channel, own]
    v = target[tile, channel, own]
    inside = rows_inside(wp.where(x < columns, rows - y, 0))
    weight = inside
    if weighted != 0:
        weight = importance[tile, own]
    a = float(0.0)
    b = float(0.0)
    c = float(0.0)
    similar = float(0.0)
    if similarity_weight > 0.0:
        phase = clock[0] % 4
        xs = window_around(x, (phase % 2) * (WINDOW / 2), columns)
        ys = window_around(y, (phase / 2) * (WINDOW / 2), rows)
        sum_u = quad(0.0)
        sum_v = quad(0.0)
        sum_squares = quad(0.0)
        sum_uv = quad(0.0)
        sum_weights = quad(0.0)
        for k in range(ys[0] / QUAD, (ys[1] + QUAD - 1) / QUAD):
            counted = rows_inside(rows - QUAD * k)
            for j in range(xs[0], xs[1]):
                p = PARTS * j + k
                window_u = wp.cw_mul(counted, image[tile, channel, p])
                window_v = target[tile, channel, p]  # 0 outside of the image
                sum_u = sum_u + window_u
                sum_v = sum_v + window_v
                sum_squares = sum_squares + (wp.cw_mul(window_u, window_u) + wp.cw_mul(window_v, window_v))
                sum_uv = sum_uv + wp.cw_mul(window_u, window_v)
                if weighted != 0:
                    sum_weights = sum_weights + importance[tile, p]
        size = float(wp.max((xs[1] - xs[0]) * (ys[1] - ys[0]), 1))
        window_weight = size
        if weighted != 0:
            window_weight = total(sum_weights)
        mean_u = total(sum_u) / size
        mean_v = total(sum_v) / size
        means = mean_u * mean_v
        squared_means = mean_u * mean_u + mean_v * mean_v
        a1 = 2.0 * means + C1
        a2 = 2.0 * (total(sum_uv) / size - means) + C2
        b1 = 1.0 / (squared_means + C1)
        b2 = 1.0 / (total(sum_squares) / size - squared_means + C2)
        s = a1 * a2 * (b1 * b2)
        similar = s * total(weight)
        share = 2.0 * similarity_weight / float(value_count) * window_weight / size
        b = share * s * b2
        c = share * a1 * (b1 * b2)
        a = share * b1 * (mean_v * (a2 * b2) - mean_u * s) + b * mean_u - c * mean_v
    e = u - v
    e_grad = (2.0 / float(value_count)) * wp.cw_mul(weight, e)
    s_grad = quad(a) - b * u + c * v
    image_grad[tile, channel, own] = wp.cw_mul(inside, e_grad - s_grad)
    loss[tile, channel, own] = total(wp.cw_mul(inside, wp.cw_mul(e, e)))
    similarity[tile, channel, own] = similar
