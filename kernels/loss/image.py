"""Loss of the image with its gradient: squared error and SSIM."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import tile_column, total

wp.set_module_options(constants.MODULE_OPTIONS)

WINDOW = wp.constant(8)
C1 = wp.constant(0.01 * 0.01)
C2 = wp.constant(0.03 * 0.03)


@wp.func
def rows_between(y0: wp.int32, y1: wp.int32) -> tile_column:
    """1 in the rows from ``y0`` to ``y1``, 0 in the others."""
    rows = tile_column(0.0)
    y = int(0)
    while y < constants.TILE:  # a range of constants would be unrolled, and take seconds to compile
        rows[y] = wp.where(y >= y0, 1.0, 0.0) * wp.where(y < y1, 1.0, 0.0)
        y += 1
    return rows


@wp.kernel
def image_loss(
    # In:
    offset: wp.int32,
    image: wp.array3d[tile_column],  # [tile_count, 3, columns]
    target: wp.array3d[tile_column],  # [tile_count, 3, columns]
    importance: wp.array2d[tile_column],  # [tile_count, columns] weight of a pixel, 0 outside of the image
    tile_cache: wp.array[wp.int32],  # [tile_count] the loss of CACHED tiles is kept, if it is known
    weighted: wp.int32,  # whether that is anything but 1 in the image; if not, it is not read
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    clock: wp.array[wp.int32],  # [1] steps so far
    similarity_weight: wp.float32,
    value_count: wp.int32,  # pixels x channels
    # Out:
    image_grad: wp.array3d[tile_column],  # [tile_count, 3, columns]
    loss: wp.array3d[wp.float32],  # [tile_count, 3, 1] sums of squares, unweighted; below 0: not known
    similarity: wp.array3d[wp.float32],  # [tile_count, 3, 1] sums of SSIM x weight; 0 without weight
):
    """Mean over pixels and channels of w e^2 (paper eq. 12, first term), and ``similarity_weight`` x the mean
    of w (1 - SSIM); w is the ``importance``, e the error. One thread a tile and channel.

    SSIM (Wang et al. 2004, eq. 13) is that of windows of 8x8 px that do not overlap; of a window, w is the
    sum over its pixels. Within one the gradient is a + b u + c v, u and v the values of a pixel in image and
    target: it costs no more than the window's sums. The windows lie inside a tile and move by half their size
    from step to step, so that no grid is left in the image: a tile has up to three from left to right, and
    three from top to bottom. What belongs to one of the latter lies in each of its rows, so that all but the
    sums over them is arithmetic with columns.
    """
    i, channel, _ = wp.tid()
    tile = offset + i
    if tile_cache[tile] == constants.CACHED and loss[tile, channel, 0] >= 0.0:
        return
    columns = wp.min(width - tile % tiles_x * constants.TILE, constants.TILE)
    rows = wp.min(height - tile / tiles_x * constants.TILE, constants.TILE)
    phase = clock[0] % 4
    shift_x = (phase % 2) * (WINDOW / 2)
    shift_y = (phase / 2) * (WINDOW / 2)
    border1 = wp.min(WINDOW - shift_y, rows)
    border2 = wp.min(2 * WINDOW - shift_y, rows)
    first = rows_between(0, border1)
    second = rows_between(border1, border2)
    third = rows_between(border2, rows)
    heights = float(border1) * first + float(border2 - border1) * second + float(rows - border2) * third
    inside = rows_between(0, rows)
    zero = tile_column(0.0)
    one = tile_column(1.0)
    c1 = tile_column(C1)
    c2 = tile_column(C2)
    factor = 2.0 / float(value_count)
    share = 2.0 * similarity_weight / float(value_count)
    squares = tile_column(0.0)
    similar = tile_column(0.0)
    x0 = int(0)
    while x0 < columns:
        x1 = wp.min((x0 + shift_x) / WINDOW * WINDOW + WINDOW - shift_x, columns)
        a = tile_column(0.0)
        b = tile_column(0.0)
        c = tile_column(0.0)
        if similarity_weight > 0.0:
            sum_u = tile_column(0.0)
            sum_v = tile_column(0.0)
            sum_squares = tile_column(0.0)
            sum_uv = tile_column(0.0)
            weight = float(x1 - x0) * inside
            for x in range(x0, x1):
                u = image[tile, channel, x]
                v = target[tile, channel, x]
                sum_u = sum_u + u
                sum_v = sum_v + v
                sum_squares = sum_squares + (wp.cw_mul(u, u) + wp.cw_mul(v, v))
                sum_uv = sum_uv + wp.cw_mul(u, v)
            if weighted != 0:
                weight = zero
                for x in range(x0, x1):
                    weight = weight + importance[tile, x]
            mean_u = tile_column(0.0)
            mean_v = tile_column(0.0)
            squared = tile_column(0.0)
            product = tile_column(0.0)
            total_weight = tile_column(0.0)
            y0 = int(0)
            y1 = border1
            window = first
            for k in range(3):
                window_u = float(0.0)
                window_v = float(0.0)
                window_squares = float(0.0)
                window_uv = float(0.0)
                window_weight = float(0.0)
                for y in range(y0, y1):
                    window_u += sum_u[y]
                    window_v += sum_v[y]
                    window_squares += sum_squares[y]
                    window_uv += sum_uv[y]
                    window_weight += weight[y]
                mean_u = mean_u + window_u * window
                mean_v = mean_v + window_v * window
                squared = squared + window_squares * window
                product = product + window_uv * window
                total_weight = total_weight + window_weight * window
                y0 = y1
                y1 = border2
                window = second
                if k == 1:
                    y1 = rows
                    window = third
            inverse = wp.cw_div(one, wp.max(float(x1 - x0) * heights, one))
            mean_u = wp.cw_mul(inverse, mean_u)
            mean_v = wp.cw_mul(inverse, mean_v)
            means = wp.cw_mul(mean_u, mean_v)
            squared_means = wp.cw_mul(mean_u, mean_u) + wp.cw_mul(mean_v, mean_v)
            a1 = 2.0 * means + c1
            a2 = 2.0 * (wp.cw_mul(inverse, product) - means) + c2
            b1 = wp.cw_div(one, squared_means + c1)
            b2 = wp.cw_div(one, wp.cw_mul(inverse, squared) - squared_means + c2)
            b12 = wp.cw_mul(b1, b2)
            s = wp.cw_mul(wp.cw_mul(a1, a2), b12)
            similar = similar + wp.cw_mul(weight, s)
            shares = share * wp.cw_mul(inverse, total_weight)
            b = wp.cw_mul(shares, wp.cw_mul(s, b2))
            c = wp.cw_mul(shares, wp.cw_mul(a1, b12))
            a = wp.cw_mul(mean_v, wp.cw_mul(a2, b2)) - wp.cw_mul(mean_u, s)
            a = wp.cw_mul(wp.cw_mul(shares, b1), a) + wp.cw_mul(b, mean_u) - wp.cw_mul(c, mean_v)
        for x in range(x0, x1):
            u = image[tile, channel, x]
            v = target[tile, channel, x]
            e = u - v
            squares = squares + wp.cw_mul(e, e)
            e_grad = factor * e
            if weighted != 0:
                e_grad = wp.cw_mul(importance[tile, x], e_grad)
            s_grad = a - wp.cw_mul(b, u) + wp.cw_mul(c, v)
            image_grad[tile, channel, x] = wp.cw_mul(inside, e_grad - s_grad)
        x0 = x1
    for x in range(columns, constants.TILE):
        image_grad[tile, channel, x] = zero
    loss[tile, channel, 0] = total(wp.cw_mul(inside, squares))
    similarity[tile, channel, 0] = total(wp.cw_mul(inside, similar))
