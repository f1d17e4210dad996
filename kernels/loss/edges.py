"""Loss of an image's edges with its gradient: the squared error of both slopes by Sobel's 3x3 filters.

A thread goes over vectors of pixels from left to right. Each is smoothed and differentiated from top to
bottom, once, and then combined with the two before it. Outside of the image there is no error.
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import quad, tile_column, total

wp.set_module_options(constants.MODULE_OPTIONS)

END = wp.constant(constants.TILE - 1)


@wp.func
def lowered(first: wp.float32, v: tile_column):
    """Return the elements one further down, after ``first``."""
    moved = tile_column(first)
    y = int(0)
    while y < END:  # a range of constants would be unrolled
        moved[y + 1] = v[y]
        y += 1
    return moved


@wp.func
def lowered(first: wp.float32, v: quad):  # noqa: F811
    """Return the elements of four one further down."""
    return quad(first, v[0], v[1], v[2])


@wp.func
def raised(v: tile_column, last: wp.float32):
    """Return the elements one further up, before ``last``."""
    moved = tile_column(last)
    y = int(0)
    while y < END:
        moved[y] = v[y + 1]
        y += 1
    return moved


@wp.func
def raised(v: quad, last: wp.float32):  # noqa: F811
    """Return the elements of four one further up."""
    return quad(v[1], v[2], v[3], last)


@wp.func
def beside(tile: wp.int32, p: wp.int32, step: wp.int32, tiles_x: wp.int32, parts: wp.int32):
    """Return the tile and place of the vector ``step`` to the right of ``p``, at most one beyond the tile;
    tile -1: outside of the image. ``parts``: vectors in a column of a tile.
    """
    t = tile
    q = p + step * parts
    if q < 0:
        q += constants.TILE * parts
        t = wp.where(tile % tiles_x > 0, tile - 1, -1)
    elif q >= constants.TILE * parts:
        q -= constants.TILE * parts
        t = wp.where((tile + 1) % tiles_x > 0, tile + 1, -1)
    return wp.vec2i(t, q)


@wp.func
def beyond(tile: wp.int32, p: wp.int32, step: wp.int32, tiles_x: wp.int32, parts: wp.int32, tiles: wp.int32):
    """Return the tile and place of the vector above (-1) or below (1), likewise."""
    t = tile
    q = p + step
    if q / parts != p / parts or q < 0:
        q -= step * parts
        t = tile + step * tiles_x
        t = wp.where(t < tiles, wp.max(t, -1), -1)
    return wp.vec2i(t, q)


@functools.cache
def make_edge_slopes(column: Any) -> wp.Kernel:
    """Return the loss of edges, for vectors of type ``column``."""
    end = int(column._length_) - 1
    parts = constants.TILE // (end + 1)

    @wp.kernel(name="edge_slopes", module="unique", module_options=constants.MODULE_OPTIONS)
    def edge_slopes(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # vectors of a tile that a thread handles: one, or columns side by side
        image: wp.array3d[column],  # [tile_count, planes, columns]
        target: wp.array3d[column],  # [tile_count, planes, columns]
        inside: wp.array2d[column],  # [tile_count, columns] 1 in the image, 0 outside
        importance: wp.array2d[column],  # [tile_count, columns] weight of a pixel, 0 outside of the image
        tiles_x: wp.int32,
        tile_count: wp.int32,
        value_count: wp.int32,  # pixels x colours
        edge_weight: wp.float32,
        # Out:
        across_grad: wp.array3d[column],  # [tile_count, planes, columns] by the error's slope to the right
        down_grad: wp.array3d[column],  # [tile_count, planes, columns] by that to the bottom
        edges: wp.array3d[wp.float32],  # [tile_count, planes, lanes] sums of squares x weight
    ):
        """Mean over pixels and colours of ``edge_weight`` w (sx^2 + sy^2): w is the ``importance``, sx and sy
        are the slopes of the error [1 / px]. One thread a tile, plane and lane.
        """
        i, plane, lane = wp.tid()
        tile = offset + i
        start = lane * lane_columns
        squares = column(0.0)
        factor = 2.0 * edge_weight / float(value_count)
        smooth = column(0.0)  # of the last vector and the one before it, and likewise
        smooth_before = column(0.0)
        steps = column(0.0)
        steps_before = column(0.0)
        for k in range(-1, lane_columns + 1):
            smooth_right = column(0.0)
            steps_right = column(0.0)
            at = beside(tile, start, k, tiles_x, parts)
            if at[0] >= 0:
                t = at[0]
                q = at[1]
                first = float(0.0)
                last = float(0.0)
                up = beyond(t, q, -1, tiles_x, parts, tile_count)
                if up[0] >= 0:
                    first = image[up[0], plane, up[1]][end] - target[up[0], plane, up[1]][end]
                    first *= inside[up[0], up[1]][end]
                low = beyond(t, q, 1, tiles_x, parts, tile_count)
                if low[0] >= 0:
                    last = image[low[0], plane, low[1]][0] - target[low[0], plane, low[1]][0]
                    last *= inside[low[0], low[1]][0]
                e = wp.cw_mul(inside[t, q], image[t, plane, q] - target[t, plane, q])
                above = lowered(first, e)
                under = raised(e, last)
                smooth_right = above + 2.0 * e + under
                steps_right = under - above
            if k > 0:
                p = start + k - 1
                across = 0.125 * (smooth_right - smooth_before)
                down = 0.125 * (steps_before + 2.0 * steps + steps_right)
                weight = importance[tile, p]
                squares = squares + wp.cw_mul(weight, wp.cw_mul(across, across) + wp.cw_mul(down, down))
                across_grad[tile, plane, p] = factor * wp.cw_mul(weight, across)
                down_grad[tile, plane, p] = factor * wp.cw_mul(weight, down)
            smooth_before = smooth
            smooth = smooth_right
            steps_before = steps
            steps = steps_right
        edges[tile, plane, lane] = edge_weight * total(squares)

    return edge_slopes


@functools.cache
def make_edge_backward(column: Any) -> wp.Kernel:
    """Return the adjoint of ``make_edge_slopes``: gradients by slopes -> gradient of the image."""
    end = int(column._length_) - 1
    parts = constants.TILE // (end + 1)

    @wp.kernel(name="edge_backward", module="unique", module_options=constants.MODULE_OPTIONS)
    def edge_backward(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # vectors of a tile that a thread handles: one, or columns side by side
        across_grad: wp.array3d[column],  # [tile_count, planes, columns] 0 outside of the image
        down_grad: wp.array3d[column],  # [tile_count, planes, columns] 0 outside of the image
        inside: wp.array2d[column],  # [tile_count, columns] 1 in the image, 0 outside
        tiles_x: wp.int32,
        tile_count: wp.int32,
        # Out:
        image_grad: wp.array3d[column],  # [tile_count, planes, columns] added to
    ):
        """Apply the filters turned by half a turn, which changes their sign. One thread a tile, plane and
        lane.
        """
        i, plane, lane = wp.tid()
        tile = offset + i
        start = lane * lane_columns
        left = column(0.0)  # what the gradient of the last vector has by now
        middle = column(0.0)  # what that of the next one has
        for k in range(-1, lane_columns + 1):
            smooth = column(0.0)
            steps = column(0.0)
            at = beside(tile, start, k, tiles_x, parts)
            if at[0] >= 0:
                t = at[0]
                q = at[1]
                first_a = float(0.0)
                first_d = float(0.0)
                up = beyond(t, q, -1, tiles_x, parts, tile_count)
                if up[0] >= 0:
                    first_a = across_grad[up[0], plane, up[1]][end]
                    first_d = down_grad[up[0], plane, up[1]][end]
                last_a = float(0.0)
                last_d = float(0.0)
                low = beyond(t, q, 1, tiles_x, parts, tile_count)
                if low[0] >= 0:
                    last_a = across_grad[low[0], plane, low[1]][0]
                    last_d = down_grad[low[0], plane, low[1]][0]
                a = across_grad[t, plane, q]
                d = down_grad[t, plane, q]
                smooth = lowered(first_a, a) + 2.0 * a + raised(a, last_a)
                steps = raised(d, last_d) - lowered(first_d, d)
            if k > 0:
                p = start + k - 1
                grad = 0.125 * wp.cw_mul(inside[tile, p], left - steps - smooth)
                image_grad[tile, plane, p] = image_grad[tile, plane, p] + grad
            left = middle - 2.0 * steps
            middle = smooth - steps

    return edge_backward
