"""Coverage -> rows of pixels by front-to-back alpha blending; see ``composite``.

As there, but into a picture as the rest of the world has it, with no copy by tiles between: each column of a
tile goes to its place when it is done.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint.flat import paint_times
from warpsplat.kernels.tile import column

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)


@wp.kernel
def pixels_forward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    background: wp.vec3,
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    # Out:
    pixels: wp.array2d[wp.vec4],  # [height, width] sRGB, and 1
):
    """Where all is flat and the canvas has a background. One thread a tile and lane."""
    i, lane = wp.tid()
    tile = offset + i
    start = tile_first[tile]
    stop = tile_stop[tile]
    x0 = tile % tiles_x * TILE
    y0 = tile / tiles_x * TILE
    rows = wp.min(height - y0, TILE)
    for x in range(lane * lane_columns, wp.min((lane + 1) * lane_columns, width - x0)):
        t = column(1.0)
        red = column(0.0)
        green = column(0.0)
        blue = column(0.0)
        for k in range(start, stop):
            paint = list_paint[k]
            slot = list_slot[k]
            share = paint[3] * t
            if slot >= 0:
                share = wp.cw_mul(share, wp.abs(coverage[slot, x]))
            red = red + paint_times(paint, 0, share)
            green = green + paint_times(paint, 1, share)
            blue = blue + paint_times(paint, 2, share)
            t = t - share
        red = red + background[0] * t
        green = green + background[1] * t
        blue = blue + background[2] * t
        for y in range(rows):
            pixels[y0 + y, x0 + x] = wp.vec4(red[y], green[y], blue[y], 1.0)


@wp.kernel
def pixels_paint_forward(
    # In:
    offset: wp.int32,
    lane_columns: wp.int32,  # columns of a tile that a thread handles
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_stop: wp.array[wp.int32],  # [tile_count]
    list_slot: wp.array[wp.int32],  # [slot_capacity] front to back, -1 - slot where FULL
    list_paint: wp.array[wp.vec4],  # [slot_capacity] colour and opacity; negative: of a gradient or picture
    coverage: wp.array2d[column],  # [slot_capacity, TILE]
    paint_columns: wp.array3d[column],  # [paint_slots, 4, TILE] of gradients: colour and opacity
    planes: wp.int32,  # 4: the canvas is transparent
    background: wp.vec3,
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    # Out:
    pixels: wp.array2d[wp.vec4],  # [height, width] sRGB premultiplied by opacity, and opacity
):
    """Of any paints and canvas."""
    i, lane = wp.tid()
    tile = offset + i
    start = tile_first[tile]
    stop = tile_stop[tile]
    x0 = tile % tiles_x * TILE
    y0 = tile / tiles_x * TILE
    rows = wp.min(height - y0, TILE)
    for x in range(lane * lane_columns, wp.min((lane + 1) * lane_columns, width - x0)):
        t = column(1.0)
        red = column(0.0)
        green = column(0.0)
        blue = column(0.0)
        for k in range(start, stop):
            paint = list_paint[k]
            slot = list_slot[k]
            share = wp.abs(paint[3]) * t
            if slot >= 0:
                share = wp.cw_mul(share, wp.abs(coverage[slot, x]))
            if paint[3] >= 0.0:
                red = red + paint_times(paint, 0, share)
                green = green + paint_times(paint, 1, share)
                blue = blue + paint_times(paint, 2, share)
            else:
                s = wp.max(slot, -1 - slot)
                share = wp.cw_mul(share, paint_columns[s, 3, x])
                red = red + wp.cw_mul(share, paint_columns[s, 0, x])
                green = green + wp.cw_mul(share, paint_columns[s, 1, x])
                blue = blue + wp.cw_mul(share, paint_columns[s, 2, x])
            t = t - share
        red = red + background[0] * t
        green = green + background[1] * t
        blue = blue + background[2] * t
        opacity = column(1.0)
        if planes == 4:
            opacity = opacity - t
        for y in range(rows):
            pixels[y0 + y, x0 + x] = wp.vec4(red[y], green[y], blue[y], opacity[y])
