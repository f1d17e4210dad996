"""Pictures as paint: markup that a file keeps as it is, drawn by a viewer. It never changes: no adjoint."""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@functools.cache
def make_forward(column: Any) -> wp.Kernel:
    """Return a kernel that copies pictures, in vectors of type ``column``."""

    @wp.kernel(name="picture_forward", module="unique", module_options=constants.MODULE_OPTIONS)
    def picture_forward(
        # In:
        offset: wp.int32,
        lane_columns: wp.int32,  # columns of a tile that a thread handles
        tiles_x: wp.int32,
        slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
        slot_tile: wp.array[wp.int32],  # [slot_capacity]
        slot_state: wp.array[wp.int32],  # [slot_capacity]
        picture: wp.array[wp.int32],  # [shape_count] -1: other paints
        picture_first: wp.array[wp.int32],  # [picture_count] its first tile in picture_columns
        picture_tiles: wp.array2d[wp.int32],  # [picture_count, 4] x0, y0, x1, y1, ends excluded
        picture_columns: wp.array3d[column],  # [picture tiles, 4, columns] colour and opacity
        # Out:
        paint_columns: wp.array3d[column],  # [paint_slots, 4, columns] colour and opacity
    ):
        """Copy the pixels of pictures into visible slots. One thread a slot and lane."""
        i, lane = wp.tid()
        slot = offset + i
        shape = slot_shape[slot]
        if shape < 0:
            return
        state = slot_state[slot]
        number = picture[shape]
        if number < 0 or state & constants.COVERED == 0 or state & constants.HIDDEN != 0:
            return
        x0 = picture_tiles[number, 0]
        y0 = picture_tiles[number, 1]
        x1 = picture_tiles[number, 2]
        tile_x = slot_tile[slot] % tiles_x
        tile_y = slot_tile[slot] / tiles_x
        inside = tile_x >= x0 and tile_x < x1 and tile_y >= y0 and tile_y < picture_tiles[number, 3]
        source = picture_first[number] + (tile_y - y0) * (x1 - x0) + tile_x - x0
        for channel in range(4):
            for x in range(lane * lane_columns, (lane + 1) * lane_columns):
                if inside:
                    paint_columns[slot, channel, x] = picture_columns[source, channel, x]
                else:
                    paint_columns[slot, channel, x] = column(0.0)

    return picture_forward
