"""Images by tiles <-> rows of pixels.

A thread has four rows of a tile and takes four pixels at a time, one below the other: in each plane these
lie side by side. All 16 rows in one thread are slower, as those of a picture whose rows are a multiple of
4 KiB share a set of the cache; a row a thread is slower, as it takes number by number.
"""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def tiles_to_pixels(
    # In:
    offset: wp.int32,
    image_quads: wp.array3d[wp.vec4],  # [tile_count, planes, TILE_PIXELS / QUAD] by columns
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    # Out:
    pixels: wp.array2d[wp.vec4],  # [height, width] sRGB and opacity
):
    """Convert to rows; with three planes the opacity is 1. One thread four rows of pixels of a tile."""
    i, part = wp.tid()
    tile = offset + i
    y = tile / tiles_x * constants.TILE + constants.QUAD * part
    x0 = tile % tiles_x * constants.TILE
    last = height - 1
    if y > last:
        return
    # A row below the last one is written to the last one, before that itself: no branch inside of the loop.
    y1 = wp.min(y + 1, last)
    y2 = wp.min(y + 2, last)
    y3 = wp.min(y + 3, last)
    planes = image_quads.shape[1]
    for x in range(wp.min(width - x0, constants.TILE)):
        k = constants.QUAD * x + part
        red = image_quads[tile, 0, k]
        green = image_quads[tile, 1, k]
        blue = image_quads[tile, 2, k]
        opacity = wp.vec4(1.0, 1.0, 1.0, 1.0)
        if planes == 4:
            opacity = image_quads[tile, 3, k]
        pixels[y3, x0 + x] = wp.vec4(red[3], green[3], blue[3], opacity[3])
        pixels[y2, x0 + x] = wp.vec4(red[2], green[2], blue[2], opacity[2])
        pixels[y1, x0 + x] = wp.vec4(red[1], green[1], blue[1], opacity[1])
        pixels[y, x0 + x] = wp.vec4(red[0], green[0], blue[0], opacity[0])


@wp.kernel
def pixels_to_tiles(
    # In:
    offset: wp.int32,
    pixels: wp.array2d[wp.vec4],  # [height, width]
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    # Out:
    image_quads: wp.array3d[wp.vec4],  # [tile_count, planes, TILE_PIXELS / QUAD] by columns; the padding is 0
):
    """Convert to tiles; with three planes the opacity is left out. One thread four rows of pixels of a
    tile.
    """
    i, part = wp.tid()
    tile = offset + i
    y = tile / tiles_x * constants.TILE + constants.QUAD * part
    x0 = tile % tiles_x * constants.TILE
    last = height - 1
    if y > last:
        return
    # A row below the last one is read as the last one and counts nothing: no branch inside of the loop.
    y1 = wp.min(y + 1, last)
    y2 = wp.min(y + 2, last)
    y3 = wp.min(y + 3, last)
    in1 = float(y1 - y)
    in2 = float(y2 - y1)
    in3 = float(y3 - y2)
    for x in range(wp.min(width - x0, constants.TILE)):
        k = constants.QUAD * x + part
        p0 = pixels[y, x0 + x]
        p1 = in1 * pixels[y1, x0 + x]
        p2 = in2 * pixels[y2, x0 + x]
        p3 = in3 * pixels[y3, x0 + x]
        image_quads[tile, 0, k] = wp.vec4(p0[0], p1[0], p2[0], p3[0])
        image_quads[tile, 1, k] = wp.vec4(p0[1], p1[1], p2[1], p3[1])
        image_quads[tile, 2, k] = wp.vec4(p0[2], p1[2], p2[2], p3[2])
        if image_quads.shape[1] == 4:
            image_quads[tile, 3, k] = wp.vec4(p0[3], p1[3], p2[3], p3[3])
