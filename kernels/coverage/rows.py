"""Rows of tiles: each thread of a coverage kernel handles the slots of a shape in one row of tiles."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

NO_ROW = wp.constant(-1)


@wp.func
def tile_row(
    slot: wp.int32,
    slot_shape: wp.array[wp.int32],
    slot_first: wp.array[wp.int32],
    shape_tiles: wp.array2d[wp.int32],
) -> wp.vec4i:
    """Return (shape, leftmost tile, width [tiles], tile's y) of the row that starts at ``slot``; the shape is
    NO_ROW where none does.
    """
    shape = slot_shape[slot]
    if shape < 0:
        return wp.vec4i(NO_ROW, 0, 0, 0)
    wide = shape_tiles[shape, 2] - shape_tiles[shape, 0]
    local = slot - slot_first[shape]
    if local % wide != 0:
        return wp.vec4i(NO_ROW, 0, 0, 0)
    return wp.vec4i(shape, shape_tiles[shape, 0], wide, shape_tiles[shape, 1] + local / wide)
