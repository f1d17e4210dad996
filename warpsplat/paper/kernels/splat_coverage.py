"""Gaussians -> coverage of each slot, and the adjoint.

With g_i = exp(-q_i / 2), cut at q > cut_i, there are two models:

- splat: coverage = 1 - prod_i (1 - min(g_i, GAUSSIAN_MAX)), paper eq. 9 with the opacity taken out of the
  product: it multiplies the coverage once, as fill-opacity does in the file.
- soft, the paper's own: coverage = 1 - prod_i (1 - o_i g_i), paper eq. 8 and 9. Each Gaussian has its own
  strength o_i inside the product, so the shape is composited with its coverage alone.

Inside a shape all Gaussians share their colour, so their order does not matter.
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import total
from warpsplat.paper import constants as paper

wp.set_module_options(constants.MODULE_OPTIONS)

EXPONENT = wp.constant(-0.5 / 256.0)


@wp.func
def rows_of(column: Any):
    """Distance of each row's centre from the top of a column of the given one's type [px]."""
    rows = type(column)(0.0)
    for r in range(len(column)):
        rows[r] = float(r) + 0.5
    return rows


@wp.func
def gaussian_column(con: wp.vec3, dx: wp.float32, dy: Any, c_dy: Any, least: Any):
    """exp(-q / 2) at offsets (dx, dy) [px] from the mean, 0 beyond the cut.

    exp(256 v) = exp(v)^256 with three terms of the series, which is right to 0.04 % where it is least, and
    nothing but vector instructions. ``con`` comes multiplied by EXPONENT, so that q becomes v; ``c_dy`` is
    its third entry times dy, ``least`` the v of the cut.
    """
    one = type(dy)(1.0)
    v = wp.cw_mul(dy, c_dy + type(dy)(2.0 * con[1] * dx)) + type(dy)(con[0] * dx * dx)
    within = wp.min(wp.max(constants.STEEP * (v - least), type(dy)(0.0)), one)
    e = one + wp.max(v, least)
    e = 0.5 * (wp.cw_mul(e, e) + one)
    e = wp.cw_mul(e, e)
    e = wp.cw_mul(e, e)
    e = wp.cw_mul(e, e)
    e = wp.cw_mul(e, e)
    e = wp.cw_mul(e, e)
    e = wp.cw_mul(e, e)
    e = wp.cw_mul(e, e)
    e = wp.cw_mul(e, e)
    return wp.cw_mul(within, e)


@wp.func
def column_range(centre: wp.float32, extent: wp.float32, left: wp.int32, right: wp.int32) -> wp.vec2i:
    """Return the first column of pixels in [left, right) that a Gaussian reaches, and one past the last."""
    first = int(wp.ceil(wp.max(centre - extent, -1.0) - 0.5))
    last = int(wp.floor(wp.min(centre + extent, 1.0e8) + 0.5))
    return wp.vec2i(wp.max(left, first), wp.min(right, last))


@functools.cache
def make_forward(column: Any, *, soft: bool) -> wp.Kernel:
    """Return the kernel of one model, for vectors of type ``column``."""
    height = column._length_
    parts = constants.TILE // height  # of a tile's column, a vector each

    @wp.kernel(
        name="soft_forward" if soft else "splat_forward",
        module="unique",
        module_options=constants.MODULE_OPTIONS,
    )
    def forward(
        # In:
        offset: wp.int32,
        lanes: wp.int32,  # threads that share the columns of a row of tiles
        slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
        slot_range: wp.array[wp.vec2i],  # [shape_count]
        shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
        gaussian_range: wp.array[wp.vec2i],  # [shape_count]
        mean: wp.array[wp.vec2],  # [gaussian_capacity] px
        conic: wp.array[wp.vec3],  # [gaussian_capacity]
        extent: wp.array[wp.vec2],  # [gaussian_capacity] px
        cut: wp.array[wp.float32],  # [gaussian_capacity] of q
        strength: wp.array[wp.float32],  # [gaussian_capacity] below 1; soft only
        # Out:
        coverage: wp.array2d[column],  # [slot_capacity, columns] in [0, 1]
        slot_state: wp.array[wp.int32],  # [slot_capacity] 0, PARTIAL where a Gaussian reaches
    ):
        """One thread a row of tiles of a shape (that of its leftmost slot) and lane."""
        i, lane = wp.tid()
        slot = offset + i
        shape = slot_shape[slot]
        if shape < 0:
            return
        wide = shape_tiles[shape, 2] - shape_tiles[shape, 0]
        local = slot - slot_range[shape][0]
        if local % wide != 0:
            return
        part = lane % parts
        step = lanes / parts
        left = constants.TILE * shape_tiles[shape, 0]
        right = left + constants.TILE * wide
        top = float(constants.TILE * (shape_tiles[shape, 1] + local / wide) + height * part)
        one = column(1.0)
        rows = rows_of(one)
        x = left + lane / parts
        while x < right:
            coverage[slot + (x - left) / constants.TILE, parts * ((x - left) % constants.TILE) + part] = one
            x += step
        gaussians = gaussian_range[shape]
        for j in range(gaussians[0], gaussians[1]):
            m = mean[j]
            e = extent[j]
            if m[1] + e[1] >= top and m[1] - e[1] <= top + float(height):
                reached = column_range(m[0], e[0], left, right)
                x = reached[0] + (lane / parts + step - reached[0] % step) % step
                if x < reached[1]:
                    con = EXPONENT * conic[j]
                    dy = rows + column(top - m[1])
                    c_dy = con[2] * dy
                    least = column(EXPONENT * cut[j])
                    while x < reached[1]:
                        s = slot + (x - left) / constants.TILE
                        slot_state[s] = constants.PARTIAL
                        g = gaussian_column(con, float(x) + 0.5 - m[0], dy, c_dy, least)
                        if soft:  # noqa: SIM108  # a conditional expression would read strength always
                            g = strength[j] * g
                        else:
                            g = wp.min(g, column(paper.GAUSSIAN_MAX))
                        k = parts * ((x - left) % constants.TILE) + part
                        coverage[s, k] = wp.cw_mul(coverage[s, k], one - g)
                        x += step
        x = left + lane / parts
        while x < right:
            s = slot + (x - left) / constants.TILE
            k = parts * ((x - left) % constants.TILE) + part
            coverage[s, k] = one - coverage[s, k]
            x += step

    return forward


@functools.cache
def make_backward(column: Any, *, soft: bool) -> wp.Kernel:
    """Return the adjoint of one model, for vectors of type ``column``."""
    height = column._length_
    parts = constants.TILE // height  # of a tile's column, a vector each

    @wp.kernel(
        name="soft_backward" if soft else "splat_backward",
        module="unique",
        module_options=constants.MODULE_OPTIONS,
    )
    def backward(
        # In:
        offset: wp.int32,
        gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
        slot_range: wp.array[wp.vec2i],  # [shape_count]
        slot_state: wp.array[wp.int32],  # [slot_capacity]
        shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
        mean: wp.array[wp.vec2],  # [gaussian_capacity]
        conic: wp.array[wp.vec3],  # [gaussian_capacity]
        extent: wp.array[wp.vec2],  # [gaussian_capacity]
        cut: wp.array[wp.float32],  # [gaussian_capacity] of q
        strength: wp.array[wp.float32],  # [gaussian_capacity] soft only
        sum_grad: wp.array2d[column],  # [slot_capacity, columns] of s, coverage = 1 - exp(-s)
        # Out:
        mean_grad: wp.array[wp.vec2],  # [gaussian_capacity] written
        conic_grad: wp.array[wp.vec3],  # [gaussian_capacity] written
        strength_grad: wp.array[wp.float32],  # [gaussian_capacity] written; soft only
    ):
        """A gather, one thread a Gaussian, over the pixels it reaches.

        s = -sum_i log(1 - o_i g_i): with p = sum_grad g / (1 - o g), 0 where a splat's g is clamped,
        dL/do = sum p and h = dL/dq = -o p / 2 (a splat's o is 1);
        dL/d(a, b, c) = sum h (dx^2, 2 dx dy, dy^2), dL/d mean = -sum 2 h (a dx + b dy, b dx + c dy).
        """
        i = offset + wp.tid()
        shape = gaussian_shape[i]
        if shape < 0:
            return
        x_grad = wp.vec2(0.0, 0.0)
        con_grad = wp.vec3(0.0, 0.0, 0.0)
        zero = column(0.0)
        sum_p = zero
        slots = slot_range[shape]
        if slots[1] > slots[0]:
            m = mean[i]
            e = extent[i]
            con = conic[i]
            peak = float(1.0)
            if soft:
                peak = strength[i]
            wide = shape_tiles[shape, 2] - shape_tiles[shape, 0]
            left = constants.TILE * shape_tiles[shape, 0]
            reached = column_range(m[0], e[0], left, left + constants.TILE * wide)
            # Vectors from top to bottom; a tile has ``parts`` of them.
            y_first = wp.max(parts * shape_tiles[shape, 1], int(wp.clamp(m[1] - e[1], 0.0, 1.0e8)) / height)
            y_stop = int(wp.clamp(m[1] + e[1], -1.0, 1.0e8)) / height + 1
            one = column(1.0)
            most = column(paper.GAUSSIAN_MAX)
            least = column(EXPONENT * cut[i])
            rows = rows_of(one)
            sum_x = zero
            sum_y = zero
            sum_xx = zero
            sum_xy = zero
            sum_yy = zero
            for y in range(y_first, wp.min(parts * shape_tiles[shape, 3], y_stop)):
                dy = rows + column(float(height * y) - m[1])
                c_dy = (EXPONENT * con[2]) * dy
                slot_row = slots[0] + (y / parts - shape_tiles[shape, 1]) * wide
                # Moments by row of pixels: few enough to stay in registers.
                moment0 = zero
                moment1 = zero
                moment2 = zero
                for x in range(reached[0], reached[1]):
                    s = slot_row + (x - left) / constants.TILE
                    if slot_state[s] == constants.PARTIAL:
                        dx = float(x) + 0.5 - m[0]
                        g = gaussian_column(EXPONENT * con, dx, dy, c_dy, least)
                        p = sum_grad[s, parts * ((x - left) % constants.TILE) + y % parts]
                        if soft:
                            p = wp.cw_div(wp.cw_mul(p, g), one - peak * g)
                        else:
                            below = wp.min(wp.max(constants.STEEP * (most - g), zero), one)
                            p = wp.cw_div(wp.cw_mul(p, wp.cw_mul(below, g)), one - wp.min(g, most))
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
            con_grad = -0.5 * peak * wp.vec3(total(sum_xx), 2.0 * total(sum_xy), total(sum_yy))
            sx = peak * total(sum_x)
            sy = peak * total(sum_y)
            x_grad = wp.vec2(con[0] * sx + con[1] * sy, con[1] * sx + con[2] * sy)
        mean_grad[i] = x_grad
        conic_grad[i] = con_grad
        if soft:
            strength_grad[i] = total(sum_p)

    return backward
