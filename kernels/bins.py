"""Tile binning: which shapes cover which tiles, front to back.

Slots are emitted shape by shape from the front, then sorted by tile. The sort is stable, so each tile's list
comes out in depth order without depth in the key.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.flat import shape_paint
from warpsplat.kernels.ranges import find_range

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def rectangles(
    # In:
    offset: wp.int32,
    sample_range: wp.array[wp.vec2i],  # [shape_count] of vertices or Gaussians
    position: wp.array[wp.vec2],  # [sample_capacity] px
    extent: wp.array[wp.vec2],  # [sample_capacity] px
    tiles_x: wp.int32,
    tiles_y: wp.int32,
    # Out:
    shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4] tile rectangle x0, y0, x1, y1, ends excluded
    front_slots: wp.array[wp.int32],  # [shape_count] tiles in it, indexed from the front
):
    """Find the tiles that the boxes of a shape's samples reach, clamped to the canvas."""
    shape = offset + wp.tid()
    low = wp.vec2(1.0e9, 1.0e9)
    high = wp.vec2(-1.0e9, -1.0e9)
    samples = sample_range[shape]
    for i in range(samples[0], samples[1]):
        low = wp.min(low, position[i] - extent[i])
        high = wp.max(high, position[i] + extent[i])
    x0 = int(0)
    y0 = int(0)
    x1 = int(0)
    y1 = int(0)
    # Written so that NaN positions give an empty rectangle.
    if (
        high[0] > 0.0
        and high[1] > 0.0
        and low[0] < float(constants.TILE * tiles_x)
        and low[1] < float(constants.TILE * tiles_y)
    ):
        x0 = int(wp.max(low[0], 0.0)) / constants.TILE
        y0 = int(wp.max(low[1], 0.0)) / constants.TILE
        x1 = wp.min(int(wp.min(high[0], 1.0e8)) / constants.TILE + 1, tiles_x)
        y1 = wp.min(int(wp.min(high[1], 1.0e8)) / constants.TILE + 1, tiles_y)
    shape_tiles[shape, 0] = x0
    shape_tiles[shape, 1] = y0
    shape_tiles[shape, 2] = x1
    shape_tiles[shape, 3] = y1
    front_slots[shape_tiles.shape[0] - 1 - shape] = wp.max(x1 - x0, 0) * wp.max(y1 - y0, 0)


@wp.kernel
def fill_slots(
    # In:
    offset: wp.int32,
    front_ends: wp.array[wp.int32],  # [shape_count] inclusive prefix sum of front_slots
    slot_range: wp.array[wp.vec2i],  # [shape_count] by shape
    shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
    tiles_x: wp.int32,
    # Out:
    slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    slot_state: wp.array[wp.int32],  # [slot_capacity] 0
    sort_keys: wp.array[wp.int32],  # [2 x slot_capacity] the tile; the second half is the sort's scratch
    sort_slots: wp.array[wp.int32],  # [2 x slot_capacity]
):
    """Write the shape and tile of a slot, and its sort key and value. One thread a slot."""
    slot = offset + wp.tid()
    shape_count = front_ends.shape[0]
    front = find_range(front_ends, shape_count, slot)
    shape = int(-1)
    tile = int(constants.INT_MAX)
    if front < shape_count:
        candidate = shape_count - 1 - front
        slots = slot_range[candidate]
        if slot >= slots[0] and slot < slots[1]:
            shape = candidate
            width = shape_tiles[shape, 2] - shape_tiles[shape, 0]
            local = slot - slots[0]
            tile = (shape_tiles[shape, 1] + local / width) * tiles_x + shape_tiles[shape, 0] + local % width
    slot_shape[slot] = shape
    slot_tile[slot] = tile
    slot_state[slot] = 0
    sort_keys[slot] = tile
    sort_slots[slot] = slot


@wp.kernel
def list_visible(
    # In:
    offset: wp.int32,
    sort_keys: wp.array[wp.int32],  # [2 x slot_capacity] tiles of slots, sorted
    sort_slots: wp.array[wp.int32],  # [2 x slot_capacity] slots by tile, front to back
    slot_capacity: wp.int32,
    slot_shape: wp.array[wp.int32],  # [slot_capacity]
    paint: wp.array[wp.int32],  # [shape_count]
    colors: wp.array[wp.vec3],  # [shape_count]
    opacities: wp.array[wp.float32],  # [shape_count]
    opacity_limit: wp.float32,  # below 1, lists go on behind opaque shapes, which count as less opaque
    keeps_colors: wp.int32,  # 1 where no gradient of colours and opacities is asked for
    # Out:
    slot_state: wp.array[wp.int32],  # [slot_capacity] HIDDEN added
    tile_range: wp.array[wp.vec2i],  # [tile_count] of the two lists
    list_slot: wp.array[wp.int32],  # [slot_capacity] slot, or -1 - slot of a FULL one
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity
    tile_shapes: wp.array[wp.int32],  # [tile_count] hash of a cacheable tile's shapes
    tile_cache: wp.array[wp.int32],  # [tile_count] 0, CACHEABLE or CACHED
):
    """List each tile's visible slots: covered, and not behind so many FULL ones that no light is left. Find
    out whether the tile is cached.
    """
    tile = offset + wp.tid()
    transmittance = float(1.0)
    start = find_range(sort_keys, slot_capacity, tile - 1)
    n = int(start)
    shapes = int(1)
    is_cacheable = keeps_colors
    k = int(start)
    while k < slot_capacity and sort_keys[k] == tile:
        slot = sort_slots[k]
        state = slot_state[slot]
        if transmittance <= constants.TRANSMITTANCE_MIN:
            slot_state[slot] = state | constants.HIDDEN
        elif state & constants.COVERED != 0:
            shape = slot_shape[slot]
            list_paint[n] = shape_paint(paint, colors, opacities, shape)
            list_slot[n] = slot
            if state == constants.FULL:
                list_slot[n] = -1 - slot
                shapes = 31 * shapes + shape + 1
                if paint[shape] == constants.FLAT:
                    transmittance *= 1.0 - wp.min(opacities[shape], opacity_limit)
            if state != constants.FULL or paint[shape] != constants.FLAT:
                is_cacheable = 0
            n += 1
        k += 1
    tile_range[tile] = wp.vec2i(start, n)
    cache = int(0)
    if is_cacheable == 1:
        cache = wp.where(shapes == tile_shapes[tile], constants.CACHED, constants.CACHEABLE)
    tile_shapes[tile] = is_cacheable * shapes
    tile_cache[tile] = cache
