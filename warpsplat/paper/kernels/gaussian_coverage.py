"""Gaussians, each of its own strength -> coverage of each slot, and the adjoint (the paper's own model).

coverage = 1 - prod_i (1 - o_i g_i), g_i = exp(-q_i / 2), cut at q > cut_i (paper eq. 8 and 9). The opacity is
inside the product, so the shape is composited with its coverage alone.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import column, total
from warpsplat.paper.kernels.splat_coverage import gaussian_column, rows_of_tile

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
PARTIAL = wp.constant(constants.PARTIAL)
EXPONENT = wp.constant(-0.5 / 256.0)


@wp.kernel
def gaussian_forward(
    # In:
    offset: wp.int32,
    lanes: wp.int32,  # each takes every lanes-th column
    slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_first: wp.array[wp.int32],  # [shape_count]
    shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
    gaussian_first: wp.array[wp.int32],  # [shape_count]
    gaussian_last: wp.array[wp.int32],  # [shape_count]
    mean: wp.array[wp.vec2],  # [gaussian_capacity] px
    conic: wp.array[wp.vec3],  # [gaussian_capacity]
    extent: wp.array[wp.vec2],  # [gaussian_capacity] px
    cut: wp.array[wp.float32],  # [gaussian_capacity] of q
    strength: wp.array[wp.float32],  # [gaussian_capacity] below 1
    # Out:
    coverage: wp.array2d[column],  # [slot_capacity, TILE] in [0, 1]
    slot_state: wp.array[wp.int32],  # [slot_capacity] 0, PARTIAL where a Gaussian reaches
):
    """One thread a row of tiles of a shape (that of its leftmost slot) and lane."""
    i, lane = wp.tid()
    slot = offset + i
    shape = slot_shape[slot]
    if shape < 0:
        return
    wide = shape_tiles[shape, 2] - shape_tiles[shape, 0]
    local = slot - slot_first[shape]
    if local % wide != 0:
        return
    left = TILE * shape_tiles[shape, 0]
    right = left + TILE * wide
    top = float(TILE * (shape_tiles[shape, 1] + local / wide))
    one = column(1.0)
    rows = rows_of_tile()
    x = left + lane
    while x < right:
        coverage[slot + (x - left) / TILE, (x - left) % TILE] = one
        x += lanes
    for j in range(gaussian_first[shape], gaussian_last[shape]):
        m = mean[j]
        e = extent[j]
        if m[1] + e[1] >= top and m[1] - e[1] <= top + float(TILE):
            x = wp.max(left, int(wp.ceil(wp.max(m[0] - e[0], -1.0) - 0.5)))
            stop = wp.min(right, int(wp.floor(wp.min(m[0] + e[0], 1.0e8) + 0.5)))
            x += (lane + lanes - x % lanes) % lanes
            if x < stop:
                con = EXPONENT * conic[j]
                dy = rows + column(top - m[1])
                c_dy = con[2] * dy
                least = column(EXPONENT * cut[j])
                peak = strength[j]
                while x < stop:
                    s = slot + (x - left) / TILE
                    slot_state[s] = PARTIAL
                    g = gaussian_column(con, float(x) + 0.5 - m[0], dy, c_dy, least)
                    k = (x - left) % TILE
                    coverage[s, k] = wp.cw_mul(coverage[s, k], one - peak * g)
                    x += lanes
    x = left + lane
    while x < right:
        s = slot + (x - left) / TILE
        coverage[s, (x - left) % TILE] = one - coverage[s, (x - left) % TILE]
        x += lanes


@wp.kernel
def gaussian_backward(
    # In:
    offset: wp.int32,
    gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    slot_first: wp.array[wp.int32],  # [shape_count]
    slot_last: wp.array[wp.int32],  # [shape_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
    mean: wp.array[wp.vec2],  # [gaussian_capacity]
    conic: wp.array[wp.vec3],  # [gaussian_capacity]
    extent: wp.array[wp.vec2],  # [gaussian_capacity]
    cut: wp.array[wp.float32],  # [gaussian_capacity] of q
    strength: wp.array[wp.float32],  # [gaussian_capacity]
    sum_grad: wp.array2d[column],  # [slot_capacity, TILE] of s, coverage = 1 - exp(-s)
    # Out:
    mean_grad: wp.array[wp.vec2],  # [gaussian_capacity] written
    conic_grad: wp.array[wp.vec3],  # [gaussian_capacity] written
    strength_grad: wp.array[wp.float32],  # [gaussian_capacity] written
):
    """A gather, one thread a Gaussian, over the pixels it reaches.

    s = -sum_i log(1 - o_i g_i): with p = sum_grad g / (1 - o g), dL/do = sum p and h = dL/dq = -o p / 2;
    dL/d(a, b, c) = sum h (dx^2, 2 dx dy, dy^2), dL/d mean = -sum 2 h (a dx + b dy, b dx + c dy).
    """
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    x_grad = wp.vec2(0.0, 0.0)
    con_grad = wp.vec3(0.0, 0.0, 0.0)
    o_grad = float(0.0)
    start = slot_first[shape]
    if slot_last[shape] > start:
        m = mean[i]
        e = extent[i]
        con = conic[i]
        peak = strength[i]
        wide = shape_tiles[shape, 2] - shape_tiles[shape, 0]
        left = TILE * shape_tiles[shape, 0]
        x_first = wp.max(left, int(wp.ceil(wp.max(m[0] - e[0], -1.0) - 0.5)))
        x_last = wp.min(left + TILE * wide, int(wp.floor(wp.min(m[0] + e[0], 1.0e8) + 0.5)))
        y_first = wp.max(shape_tiles[shape, 1], int(wp.clamp(m[1] - e[1], 0.0, 1.0e8)) / TILE)
        y_last = wp.min(shape_tiles[shape, 3], int(wp.clamp(m[1] + e[1], -1.0, 1.0e8)) / TILE + 1)
        one = column(1.0)
        zero = column(0.0)
        least = column(EXPONENT * cut[i])
        rows = rows_of_tile()
        sum_p = zero
        sum_x = zero
        sum_y = zero
        sum_xx = zero
        sum_xy = zero
        sum_yy = zero
        for tile_y in range(y_first, y_last):
            dy = rows + column(float(TILE * tile_y) - m[1])
            c_dy = (EXPONENT * con[2]) * dy
            slot_row = start + (tile_y - shape_tiles[shape, 1]) * wide
            # Moments by row of pixels: few enough to stay in registers.
            moment0 = zero
            moment1 = zero
            moment2 = zero
            for x in range(x_first, x_last):
                s = slot_row + (x - left) / TILE
                if slot_state[s] == PARTIAL:
                    dx = float(x) + 0.5 - m[0]
                    g = gaussian_column(EXPONENT * con, dx, dy, c_dy, least)
                    p = wp.cw_mul(sum_grad[s, (x - left) % TILE], g)
                    p = wp.cw_div(p, one - peak * g)
                    moment0 = moment0 + p
                    moment1 = moment1 + dx * p
                    moment2 = moment2 + (dx * dx) * p
            moment0_dy = wp.cw_mul(moment0, dy)
            sum_p = sum_p + moment0
            sum_x = sum_x + moment1
            sum_y = sum_y + moment0_dy
            sum_xx = sum_xx + moment2
            sum_xy = sum_xy + wp.cw_mul(moment1, dy)
            sum_yy = sum_yy + wp.cw_mul(moment0_dy, dy)
        o_grad = total(sum_p)
        con_grad = -0.5 * peak * wp.vec3(total(sum_xx), 2.0 * total(sum_xy), total(sum_yy))
        sx = peak * total(sum_x)
        sy = peak * total(sum_y)
        x_grad = wp.vec2(con[0] * sx + con[1] * sy, con[1] * sx + con[2] * sy)
    mean_grad[i] = x_grad
    conic_grad[i] = con_grad
    strength_grad[i] = o_grad
