"""Tile binning: which parts cover which tiles, front to back.

Slots are emitted part by part from the front, then sorted by tile. The sort is stable, so each tile's list
comes out in depth order without depth in the key.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import find_range

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
INT_MAX = wp.constant(constants.INT_MAX)
TRANSMITTANCE_MIN = wp.constant(constants.TRANSMITTANCE_MIN)
COVERED = wp.constant(constants.COVERED)
FULL = wp.constant(constants.FULL)
HIDDEN = wp.constant(constants.HIDDEN)


@wp.kernel
def part_rectangles(
    # In:
    first: wp.int32,
    part_first: wp.array[wp.int32],  # [part_count] Gaussians
    part_last: wp.array[wp.int32],  # [part_count]
    mean: wp.array[wp.vec2],  # [capacity] px
    extent: wp.array[wp.vec2],  # [capacity] px
    tiles_x: wp.int32,
    tiles_y: wp.int32,
    # Out:
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4] tile rectangle x0, y0, x1, y1, ends excluded
    front_slots: wp.array[wp.int32],  # [part_count] tiles in it, indexed from the front
):
    """Tiles that the Gaussians' boxes reach, clamped to the canvas."""
    part = first + wp.tid()
    low = wp.vec2(1.0e9, 1.0e9)
    high = wp.vec2(-1.0e9, -1.0e9)
    for i in range(part_first[part], part_last[part]):
        low = wp.min(low, mean[i] - extent[i])
        high = wp.max(high, mean[i] + extent[i])
    x0 = int(0)
    y0 = int(0)
    x1 = int(0)
    y1 = int(0)
    # Written so that NaN positions give an empty rectangle.
    if high[0] > 0.0 and high[1] > 0.0 and low[0] < float(TILE * tiles_x) and low[1] < float(TILE * tiles_y):
        x0 = int(wp.max(low[0], 0.0)) / TILE
        y0 = int(wp.max(low[1], 0.0)) / TILE
        x1 = wp.min(int(wp.min(high[0], 1.0e8)) / TILE + 1, tiles_x)
        y1 = wp.min(int(wp.min(high[1], 1.0e8)) / TILE + 1, tiles_y)
    part_tiles[part, 0] = x0
    part_tiles[part, 1] = y0
    part_tiles[part, 2] = x1
    part_tiles[part, 3] = y1
    front_slots[part_tiles.shape[0] - 1 - part] = wp.max(x1 - x0, 0) * wp.max(y1 - y0, 0)


@wp.kernel
def fill_slots(
    # In:
    first: wp.int32,
    front_ends: wp.array[wp.int32],  # [part_count] inclusive prefix sum of front_slots
    slot_first: wp.array[wp.int32],  # [part_count] by part
    slot_last: wp.array[wp.int32],  # [part_count] by part
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    tiles_x: wp.int32,
    # Out:
    slot_part: wp.array[wp.int32],  # [capacity] -1: unused
    slot_tile: wp.array[wp.int32],  # [capacity]
    slot_state: wp.array[wp.int32],  # [capacity] 0
    sort_keys: wp.array[wp.int32],  # [2 x capacity] the tile; the second half is the sort's scratch
    sort_slots: wp.array[wp.int32],  # [2 x capacity]
):
    """One thread a slot: its part and tile, as sort key and value."""
    slot = first + wp.tid()
    part_count = front_ends.shape[0]
    front = find_range(front_ends, part_count, slot)
    part = int(-1)
    tile = int(INT_MAX)
    if front < part_count:
        candidate = part_count - 1 - front
        if slot < slot_last[candidate]:
            part = candidate
            width = part_tiles[part, 2] - part_tiles[part, 0]
            local = slot - slot_first[part]
            tile = (part_tiles[part, 1] + local / width) * tiles_x + part_tiles[part, 0] + local % width
    slot_part[slot] = part
    slot_tile[slot] = tile
    slot_state[slot] = 0
    sort_keys[slot] = tile
    sort_slots[slot] = slot


@wp.kernel
def clear_ranges(
    # In:
    first: wp.int32,
    # Out:
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_last: wp.array[wp.int32],  # [tile_count]
):
    """Tiles that nothing reaches keep an empty range."""
    tile = first + wp.tid()
    tile_first[tile] = 0
    tile_last[tile] = 0


@wp.kernel
def tile_ranges(
    # In:
    first: wp.int32,
    sort_keys: wp.array[wp.int32],  # [2 x capacity] sorted
    capacity: wp.int32,
    # Out:
    tile_first: wp.array[wp.int32],  # [tile_count] range of each tile in the sorted list
    tile_last: wp.array[wp.int32],  # [tile_count]
):
    """A thread at each border between two keys writes the one's end and the other's start."""
    i = first + wp.tid()
    tile = sort_keys[i]
    if tile == INT_MAX:
        return
    before = int(-1)
    if i > 0:
        before = sort_keys[i - 1]
    after = int(INT_MAX)
    if i + 1 < capacity:
        after = sort_keys[i + 1]
    if before != tile:
        tile_first[tile] = i
    if after != tile:
        tile_last[tile] = i + 1


@wp.kernel
def list_visible(
    # In:
    first: wp.int32,
    sort_slots: wp.array[wp.int32],  # [2 x capacity] slots by tile, front to back
    slot_part: wp.array[wp.int32],  # [capacity]
    opacity_count: wp.int32,
    colors: wp.array[wp.vec3],  # [curve_count]
    opacities: wp.array2d[wp.float32],  # [curve_count, opacity_count]
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_last: wp.array[wp.int32],  # [tile_count]
    # Out:
    slot_state: wp.array[wp.int32],  # [capacity] HIDDEN added
    tile_stop: wp.array[wp.int32],  # [tile_count] end of the tile's range in the two lists
    list_slot: wp.array[wp.int32],  # [capacity] slot, or -1 - slot of a FULL one
    list_paint: wp.array[wp.vec4],  # [capacity] colour and opacity
):
    """Each tile's slots that can be seen: covered, and not behind so many FULL ones that no light is left."""
    tile = first + wp.tid()
    light = float(1.0)
    n = tile_first[tile]
    for k in range(tile_first[tile], tile_last[tile]):
        slot = sort_slots[k]
        state = slot_state[slot]
        if light <= TRANSMITTANCE_MIN:
            slot_state[slot] = state | HIDDEN
        elif state & COVERED != 0:
            part = slot_part[slot]
            color = colors[part / opacity_count]
            opacity = opacities[part / opacity_count, part % opacity_count]
            list_paint[n] = wp.vec4(color[0], color[1], color[2], opacity)
            list_slot[n] = slot
            if state == FULL:
                list_slot[n] = -1 - slot
                light *= 1.0 - opacity
            n += 1
    tile_stop[tile] = n
