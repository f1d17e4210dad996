"""Gaussians -> coverage of each slot, and the adjoint.

Inside a part all Gaussians share colour and opacity, so their order does not matter:
coverage = 1 - prod_i (1 - g_i), g_i = min(exp(-q_i / 2), GAUSSIAN_MAX), cut at q > Q_MAX (paper eq. 9 with
the opacity taken out of the product: it multiplies the coverage once, as fill-opacity does in the file).

Along a row of pixels q is quadratic in x, so g follows from its left neighbour by two multiplications:
g(x + 1) = g(x) r(x), r(x + 1) = r(x) exp(-a). An exp a pixel would cost several times as much on a CPU.
"""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
PARTIAL = wp.constant(constants.PARTIAL)
Q_MAX = wp.constant(constants.Q_MAX)
GAUSSIAN_MAX = wp.constant(constants.GAUSSIAN_MAX)


@wp.func
def first_pixel(x: wp.float32) -> wp.int32:
    """First pixel whose centre is at or right of ``x``."""
    return int(wp.ceil(x - 0.5))


@wp.func
def chord(con: wp.vec3, dy: wp.float32) -> wp.vec2:
    """Interval of dx with q(dx, dy) <= Q_MAX; empty (low > high) where the row misses the ellipse."""
    b_dy = con[1] * dy
    discriminant = b_dy * b_dy - con[0] * (con[2] * dy * dy - Q_MAX)
    if discriminant <= 0.0:
        return wp.vec2(1.0, -1.0)
    root = wp.sqrt(discriminant)
    return wp.vec2((-b_dy - root) / con[0], (-b_dy + root) / con[0])


@wp.func
def gaussian_at(con: wp.vec3, dx: wp.float32, dy: wp.float32) -> wp.float32:
    """exp(-q / 2) at the offset (dx, dy) [px] from the mean."""
    return wp.exp(-0.5 * (con[0] * dx * dx + 2.0 * con[1] * dx * dy + con[2] * dy * dy))


@wp.kernel
def splat_forward(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,  # pixel rows of a tile that a thread handles
    slot_part: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    tiles_x: wp.int32,
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    mean: wp.array[wp.vec2],  # [gaussian_capacity] px
    conic: wp.array[wp.vec3],  # [gaussian_capacity]
    extent: wp.array[wp.vec2],  # [gaussian_capacity] px
    # Out:
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] in [0, 1]; by column
    slot_state: wp.array[wp.int32],  # [slot_capacity] 0, PARTIAL where a Gaussian reaches
):
    """One thread a slot and lane: the whole tile on a CPU, one row on a GPU."""
    i, lane = wp.tid()
    slot = first + i
    part = slot_part[slot]
    if part < 0:
        return
    tile_x = TILE * (slot_tile[slot] % tiles_x)
    tile_y = TILE * (slot_tile[slot] / tiles_x)
    row_first = tile_y + lane * lane_rows
    row_last = row_first + lane_rows
    for x in range(TILE):
        for y in range(lane * lane_rows, (lane + 1) * lane_rows):
            coverage[slot, TILE * x + y] = 1.0
    seen = int(0)
    for j in range(part_first[part], part_last[part]):
        m = mean[j]
        e = extent[j]
        if (
            m[0] + e[0] >= float(tile_x)
            and m[0] - e[0] <= float(tile_x + TILE)
            and m[1] + e[1] >= float(row_first)
            and m[1] - e[1] <= float(row_last)
        ):
            con = conic[j]
            falloff = wp.exp(-con[0])
            y0 = wp.max(row_first, first_pixel(m[1] - e[1]))
            y1 = wp.min(row_last, first_pixel(m[1] + e[1]))
            for y in range(y0, y1):
                dy = float(y) + 0.5 - m[1]
                span = chord(con, dy)
                x0 = wp.max(tile_x, first_pixel(m[0] + span[0]))
                x1 = wp.min(tile_x + TILE, first_pixel(m[0] + span[1]))
                if x0 < x1:
                    seen = 1
                    dx = float(x0) + 0.5 - m[0]
                    g = gaussian_at(con, dx, dy)
                    ratio = wp.exp(-(con[0] * (dx + 0.5) + con[1] * dy))
                    for x in range(x0, x1):
                        p = TILE * (x - tile_x) + y - tile_y
                        coverage[slot, p] = coverage[slot, p] * (1.0 - wp.min(g, GAUSSIAN_MAX))
                        g *= ratio
                        ratio *= falloff
    for x in range(TILE):
        for y in range(lane * lane_rows, (lane + 1) * lane_rows):
            coverage[slot, TILE * x + y] = 1.0 - coverage[slot, TILE * x + y]
    if seen != 0:
        wp.atomic_or(slot_state, slot, PARTIAL)


@wp.kernel
def splat_backward(
    # In:
    first: wp.int32,
    width: wp.int32,  # px
    height: wp.int32,  # px
    gaussian_part: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    slot_first: wp.array[wp.int32],  # [part_count]
    slot_last: wp.array[wp.int32],  # [part_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    mean: wp.array[wp.vec2],  # [gaussian_capacity]
    conic: wp.array[wp.vec3],  # [gaussian_capacity]
    extent: wp.array[wp.vec2],  # [gaussian_capacity]
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    coverage_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    # Out:
    mean_grad: wp.array[wp.vec2],  # [gaussian_capacity] written
    conic_grad: wp.array[wp.vec3],  # [gaussian_capacity] written
):
    """A gather, one thread a Gaussian, over the pixels it reaches.

    d coverage / d g = (1 - coverage) / (1 - g) and dg / dq = -g / 2 below the clamp; with h = dL/dq:
    dL/d(a, b, c) = sum h (dx^2, 2 dx dy, dy^2), dL/d mean = -sum 2 h (a dx + b dy, b dx + c dy).
    """
    i = first + wp.tid()
    part = gaussian_part[i]
    if part < 0:
        return
    x_grad = wp.vec2(0.0, 0.0)
    con_grad = wp.vec3(0.0, 0.0, 0.0)
    start = slot_first[part]
    if slot_last[part] > start:
        m = mean[i]
        e = extent[i]
        con = conic[i]
        falloff = wp.exp(-con[0])
        tiles_x0 = part_tiles[part, 0]
        tiles_y0 = part_tiles[part, 1]
        tiles_wide = part_tiles[part, 2] - tiles_x0
        y0 = wp.max(0, first_pixel(wp.max(m[1] - e[1], 0.0)))
        y1 = wp.min(height, first_pixel(wp.min(m[1] + e[1], float(height) + 1.0)))
        sum_x = float(0.0)
        sum_y = float(0.0)
        sum_xx = float(0.0)
        sum_xy = float(0.0)
        sum_yy = float(0.0)
        for y in range(y0, y1):
            dy = float(y) + 0.5 - m[1]
            span = chord(con, dy)
            x0 = wp.max(0, first_pixel(wp.max(m[0] + span[0], 0.0)))
            x1 = wp.min(width, first_pixel(wp.min(m[0] + span[1], float(width) + 1.0)))
            if x0 < x1:
                dx = float(x0) + 0.5 - m[0]
                g = gaussian_at(con, dx, dy)
                ratio = wp.exp(-(con[0] * (dx + 0.5) + con[1] * dy))
                row_sum = float(0.0)
                row_x = float(0.0)
                row_xx = float(0.0)
                slot_row = start + (y / TILE - tiles_y0) * tiles_wide - tiles_x0
                x = x0
                while x < x1:
                    tile_x = x / TILE
                    slot = slot_row + tile_x
                    base = y % TILE - TILE * TILE * tile_x
                    lit = slot_state[slot] == PARTIAL
                    stop = wp.min(x1, (tile_x + 1) * TILE)
                    for xx in range(x, stop):
                        if lit and g < GAUSSIAN_MAX:
                            p = base + TILE * xx
                            h = -0.5 * coverage_grad[slot, p] * (1.0 - coverage[slot, p]) * g / (1.0 - g)
                            row_sum += h
                            row_x += h * dx
                            row_xx += h * dx * dx
                        g *= ratio
                        ratio *= falloff
                        dx += 1.0
                    x = stop
                sum_x += row_x
                sum_y += row_sum * dy
                sum_xx += row_xx
                sum_xy += row_x * dy
                sum_yy += row_sum * dy * dy
        con_grad = wp.vec3(sum_xx, 2.0 * sum_xy, sum_yy)
        x_grad = -2.0 * wp.vec2(con[0] * sum_x + con[1] * sum_y, con[1] * sum_x + con[2] * sum_y)
    mean_grad[i] = x_grad
    conic_grad[i] = con_grad
