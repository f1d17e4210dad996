"""Loss of an image's edges with its gradient: neighbouring pixels should differ as they do in the target."""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import quad, tile_column, total

wp.set_module_options(constants.MODULE_OPTIONS)

LAST = wp.constant(constants.TILE - 1)


@wp.func
def below(first: wp.float32, v: tile_column):
    """Return the elements one further down, after ``first``."""
    moved = tile_column(first)
    y = int(0)
    while y < LAST:  # a range of constants would be unrolled
        moved[y + 1] = v[y]
        y += 1
    return moved


@wp.func
def below(first: wp.float32, v: quad):  # noqa: F811
    """Return the elements of four one further down."""
    return quad(first, v[0], v[1], v[2])


@wp.func
def above(v: tile_column, last: wp.float32):
    """Return the elements one further up, before ``last``."""
    moved = tile_column(last)
    y = int(0)
    while y < LAST:
        moved[y] = v[y + 1]
        y += 1
    return moved


@wp.func
def above(v: quad, last: wp.float32):  # noqa: F811
    """Return the elements of four one further up."""
    return quad(v[1], v[2], v[3], last)


@functools.cache
def make_edge_loss(column: Any) -> wp.Kernel:
    """Return the loss of edges, for vectors of type ``column``."""
    end = int(column._length_) - 1  # of a vector
    parts = constants.TILE // (end + 1)  # vectors in a column of a tile
    vectors = constants.TILE * parts  # in a tile

    @wp.kernel(name="edge_loss", module="unique", module_options=constants.MODULE_OPTIONS)
    def edge_loss(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # vectors of a tile that a thread handles
        image: wp.array3d[column],  # [tile_count, planes, columns]
        target: wp.array3d[column],  # [tile_count, planes, columns]
        importance: wp.array2d[column],  # [tile_count, columns] weight of a pixel, 0 outside of the image
        tiles_x: wp.int32,
        tile_count: wp.int32,
        value_count: wp.int32,  # pixels x colours
        edge_weight: wp.float32,
        # Out:
        image_grad: wp.array3d[column],  # [tile_count, planes, columns] added to
        edges: wp.array3d[wp.float32],  # [tile_count, planes, lanes] sums of squares x weight
    ):
        """Mean over pixels and colours of w (e - e')^2, summed over the pairs of pixels side by side or one
        below the other: e and e' are their errors, w the smaller ``importance`` of the two. The gradient is
        the sum of 2 w (e - e') over a pixel's four neighbours; for one that is missing stands the pixel
        itself. One thread a tile, plane and lane.
        """
        i, plane, lane = wp.tid()
        tile = offset + i
        across = tile % tiles_x
        squares = column(0.0)
        factor = edge_weight / float(value_count)
        for p in range(lane * lane_columns, (lane + 1) * lane_columns):
            own = image[tile, plane, p] - target[tile, plane, p]
            weight = importance[tile, p]
            # Left.
            t = tile
            q = p - parts
            if q < 0:
                t = wp.where(across > 0, tile - 1, tile)
                q = wp.where(across > 0, q + vectors, p)
            d = own - (image[t, plane, q] - target[t, plane, q])
            pull = wp.cw_mul(wp.min(weight, importance[t, q]), d)
            pulls = pull
            squares = squares + wp.cw_mul(pull, d)
            # Right.
            t = tile
            q = p + parts
            if q >= vectors:
                t = wp.where(across + 1 < tiles_x, tile + 1, tile)
                q = wp.where(across + 1 < tiles_x, q - vectors, p)
            d = own - (image[t, plane, q] - target[t, plane, q])
            pull = wp.cw_mul(wp.min(weight, importance[t, q]), d)
            pulls = pulls + pull
            squares = squares + wp.cw_mul(pull, d)
            # Above: the last element of the vector before, and the own ones without the last.
            t = tile
            q = p - 1
            if p % parts == 0:
                t = tile - tiles_x
                q = p + parts - 1
            e = own[0]
            w = float(0.0)
            if t >= 0:
                e = image[t, plane, q][end] - target[t, plane, q][end]
                w = importance[t, q][end]
            d = own - below(e, own)
            pull = wp.cw_mul(wp.min(weight, below(w, weight)), d)
            pulls = pulls + pull
            squares = squares + wp.cw_mul(pull, d)
            # Below.
            t = tile
            q = p + 1
            if q % parts == 0:
                t = tile + tiles_x
                q = q - parts
            e = own[end]
            w = float(0.0)
            if t < tile_count:
                e = image[t, plane, q][0] - target[t, plane, q][0]
                w = importance[t, q][0]
            d = own - above(own, e)
            pull = wp.cw_mul(wp.min(weight, above(weight, w)), d)
            pulls = pulls + pull
            squares = squares + wp.cw_mul(pull, d)
            image_grad[tile, plane, p] = image_grad[tile, plane, p] + 2.0 * factor * pulls
        edges[tile, plane, lane] = 0.5 * edge_weight * total(squares)

    return edge_loss
