"""How much of each shape is seen: what compositing multiplies its colour with.

seen = opacity x coverage x what shines through all that lies in front, pixel by pixel. The image changes by
seen x d where a shape's colour changes by d, whatever that colour is.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import column

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def visibility(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] opacity last, negative of gradients
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] of gradients: opacity last
    # Out:
    seen: wp.array2d[column],  # [slot_capacity, TILE] written for slots on the lists; others kept
):
    """One thread a tile and lane."""
    i, lane = wp.tid()
    tile = offset + i
    for x in range(lane * lane_columns, (lane + 1) * lane_columns):
        t = column(1.0)
        for k in range(tile_first[tile], tile_stop[tile]):
            opacity = list_paint[k][3]
            slot = list_slot[k]
            share = wp.abs(opacity) * t
            if slot >= 0:
                share = wp.cw_mul(share, wp.abs(coverage[slot, x]))
            else:
                slot = -1 - slot
            if opacity < 0.0:
                share = wp.cw_mul(share, paint_columns[slot, 3, x])
            seen[slot, x] = share
            t = t - share
