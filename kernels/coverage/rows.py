"""The share of a thread of a coverage kernel: the slots of a shape in one row of tiles, or some of them."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

NO_ROW = wp.constant(-1)


@wp.func
def one_tile(
    slot: wp.int32,
    slot_shape: wp.array[wp.int32],
    slot_range: wp.array[wp.vec2i],
    shape_tiles: wp.array2d[wp.int32],
) -> wp.vec4i:
    """Return (shape, tile's x, 1, tile's y) of ``slot`` as a row of one tile; the shape is NO_ROW where the
    slot is unused.
    """
    shape = slot_shape[slot]
    if shape < 0:
        return wp.vec4i(NO_ROW, 0, 0, 0)
    wide = shape_tiles[shape, 2] - shape_tiles[shape, 0]
    local = slot - slot_range[shape][0]
    return wp.vec4i(shape, shape_tiles[shape, 0] + local % wide, 1, shape_tiles[shape, 1] + local / wide)


@wp.func
def tile_row(
    slot: wp.int32,
    slot_shape: wp.array[wp.int32],
    slot_range: wp.array[wp.vec2i],
    shape_tiles: wp.array2d[wp.int32],
) -> wp.vec4i:
    """Return (shape, leftmost tile, width [tiles], tile's y) of the row that starts at ``slot``; the shape is
    NO_ROW where none does.
    """
    tile = one_tile(slot, slot_shape, slot_range, shape_tiles)
    shape = tile[0]
    if shape < 0:
        return tile
    left = shape_tiles[shape, 0]
    if tile[1] != left:
        return wp.vec4i(NO_ROW, 0, 0, 0)
    return wp.vec4i(shape, left, shape_tiles[shape, 2] - left, tile[3])


@wp.func
def partial_run(
    slot: wp.int32,
    slot_shape: wp.array[wp.int32],
    slot_range: wp.array[wp.vec2i],
    slot_state: wp.array[wp.int32],
    shape_tiles: wp.array2d[wp.int32],
) -> wp.vec2i:
    """Return the range of PARTIAL slots side by side in a row of tiles that starts at ``slot``, as numbers of
    tiles from the row's left border; empty where none starts there.
    """
    shape = slot_shape[slot]
    if shape < 0 or slot_state[slot] & constants.PARTIAL != constants.PARTIAL:
        return wp.vec2i(0, 0)
    wide = shape_tiles[shape, 2] - shape_tiles[shape, 0]
    first = (slot - slot_range[shape][0]) % wide
    if first > 0:
        if slot_state[slot - 1] & constants.PARTIAL == constants.PARTIAL:
            return wp.vec2i(0, 0)
    last = first + 1
    for s in range(slot + 1, slot + wide - first):
        if slot_state[s] & constants.PARTIAL != constants.PARTIAL:
            break
        last += 1
    return wp.vec2i(first, last)
