"""Losses of the image with their gradients: L2 and SSIM."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import column, total

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
WINDOW = wp.constant(8)
C1 = wp.constant(0.01 * 0.01)
C2 = wp.constant(0.03 * 0.03)


@wp.kernel
def l2_loss(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,
    image: wp.array3d[column],  # [tile_count, 3, TILE]
    target: wp.array3d[column],  # [tile_count, 3, TILE]
    inside: wp.array2d[column],  # [tile_count, TILE] 1 for pixels of the image
    value_count: wp.int32,  # pixels x channels
    # Out:
    image_grad: wp.array3d[column],  # [tile_count, 3, TILE]
    loss: wp.array2d[wp.float32],  # [tile_count, lanes] sums of squares
):
    """Mean squared error over pixels and channels (paper eq. 12, first term) and its gradient."""
    i, lane = wp.tid()
    tile = offset + i
    factor = 2.0 / float(value_count)
    squares = column(0.0)
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        for channel in range(3):
            difference = wp.cw_mul(inside[tile, x], image[tile, channel, x] - target[tile, channel, x])
            image_grad[tile, channel, x] = factor * difference
            squares = squares + wp.cw_mul(difference, difference)
    loss[tile, lane] = total(squares)


@wp.func
def window_end(start: wp.int32, shift: wp.int32) -> wp.int32:
    """End of the window that starts at ``start``: their grid is shifted, and cut where the tile ends."""
    return wp.min((start + shift) / WINDOW * WINDOW + WINDOW - shift, TILE)


@wp.func
def ssim_slopes(
    n: wp.float32, x: wp.float32, y: wp.float32, xx: wp.float32, yy: wp.float32, xy: wp.float32
) -> wp.vec4:
    """SSIM of a window with ``n`` pixels from its sums (Wang et al. 2004, eq. 13), and its gradient by the
    first image: constant, factor of x, factor of y.
    """
    mx = x / n
    my = y / n
    a1 = 2.0 * mx * my + C1
    a2 = 2.0 * (xy / n - mx * my) + C2
    b1 = mx * mx + my * my + C1
    b2 = xx / n - mx * mx + yy / n - my * my + C2
    s = a1 * a2 / (b1 * b2)
    slope_x = -2.0 * s / b2
    slope_y = 2.0 * a1 / (b1 * b2)
    constant = 2.0 * (my * a2 / b2 - mx * s) / b1 - slope_x * mx - slope_y * my
    return wp.vec4(s, constant, slope_x, slope_y)


@wp.kernel
def ssim_backward(
    # In:
    offset: wp.int32,
    image: wp.array3d[column],  # [tile_count, 3, TILE]
    target: wp.array3d[column],  # [tile_count, 3, TILE]
    inside: wp.array2d[column],  # [tile_count, TILE] 1 for pixels of the image
    clock: wp.array[wp.int32],  # [1] steps so far
    weight: wp.float32,
    value_count: wp.int32,  # pixels x channels
    # Out:
    image_grad: wp.array3d[column],  # [tile_count, 3, TILE] added to
    similarity: wp.array2d[wp.float32],  # [tile_count, 3] sum over windows of SSIM x pixels
):
    """``weight`` x (1 - SSIM) with windows of 8x8 px that do not overlap.

    Within such a window the gradient is a + b x + c y, x and y the pixel's values: a window costs no more
    than its sums. The windows lie inside a tile and move by half their size from step to step, so that no
    grid is left in the image. One thread a tile and channel.
    """
    i, channel = wp.tid()
    tile = offset + i
    phase = clock[0] % 4
    shift_x = (phase % 2) * (WINDOW / 2)
    shift_y = (phase / 2) * (WINDOW / 2)
    factor = weight / float(value_count)
    sum_all = float(0.0)
    x0 = int(0)
    while x0 < TILE:
        x1 = window_end(x0, shift_x)
        n = column(0.0)
        sx = column(0.0)
        sy = column(0.0)
        sxx = column(0.0)
        syy = column(0.0)
        sxy = column(0.0)
        for x in range(x0, x1):
            mask = inside[tile, x]
            u = wp.cw_mul(mask, image[tile, channel, x])
            v = wp.cw_mul(mask, target[tile, channel, x])
            n = n + mask
            sx = sx + u
            sy = sy + v
            sxx = sxx + wp.cw_mul(u, u)
            syy = syy + wp.cw_mul(v, v)
            sxy = sxy + wp.cw_mul(u, v)
        a = column(0.0)
        b = column(0.0)
        c = column(0.0)
        y0 = int(0)
        while y0 < TILE:
            y1 = window_end(y0, shift_y)
            count = float(0.0)
            mx = float(0.0)
            my = float(0.0)
            xx = float(0.0)
            yy = float(0.0)
            xy = float(0.0)
            for y in range(y0, y1):
                count += n[y]
                mx += sx[y]
                my += sy[y]
                xx += sxx[y]
                yy += syy[y]
                xy += sxy[y]
            if count > 0.0:
                slopes = ssim_slopes(count, mx, my, xx, yy, xy)
                sum_all += slopes[0] * count
                for y in range(y0, y1):
                    a[y] = factor * slopes[1]
                    b[y] = factor * slopes[2]
                    c[y] = factor * slopes[3]
            y0 = y1
        for x in range(x0, x1):
            gradient = a + wp.cw_mul(b, image[tile, channel, x]) + wp.cw_mul(c, target[tile, channel, x])
            gradient = wp.cw_mul(inside[tile, x], gradient)
            image_grad[tile, channel, x] = image_grad[tile, channel, x] - gradient
        x0 = x1
    similarity[tile, channel] = sum_all
