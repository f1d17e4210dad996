"""Images by tiles <-> rows of pixels, as the rest of the world has them."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)


@wp.kernel
def tiles_to_pixels(
    # In:
    offset: wp.int32,
    image_pixels: wp.array3d[wp.float32],  # [tile_count, planes, TILE_PIXELS] by columns
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    # Out:
    pixels: wp.array2d[wp.vec4],  # [height, width] sRGB premultiplied by opacity, and opacity
):
    """One thread a row of pixels of a tile. Of three planes the opacity is 1."""
    i, row = wp.tid()
    tile = offset + i
    y = tile / tiles_x * TILE + row
    if y >= height:
        return
    x0 = tile % tiles_x * TILE
    for x in range(wp.min(width - x0, TILE)):
        k = TILE * x + row
        opacity = float(1.0)
        if image_pixels.shape[1] == 4:
            opacity = image_pixels[tile, 3, k]
        pixels[y, x0 + x] = wp.vec4(
            image_pixels[tile, 0, k], image_pixels[tile, 1, k], image_pixels[tile, 2, k], opacity
        )


@wp.kernel
def pixels_to_tiles(
    # In:
    offset: wp.int32,
    pixels: wp.array2d[wp.vec4],  # [height, width]
    width: wp.int32,  # [px]
    height: wp.int32,  # [px]
    tiles_x: wp.int32,
    # Out:
    image_pixels: wp.array3d[wp.float32],  # [tile_count, planes, TILE_PIXELS] by columns; the padding is kept
):
    """One thread a row of pixels of a tile. Three planes leave the opacity out."""
    i, row = wp.tid()
    tile = offset + i
    y = tile / tiles_x * TILE + row
    if y >= height:
        return
    x0 = tile % tiles_x * TILE
    for x in range(wp.min(width - x0, TILE)):
        k = TILE * x + row
        value = pixels[y, x0 + x]
        image_pixels[tile, 0, k] = value[0]
        image_pixels[tile, 1, k] = value[1]
        image_pixels[tile, 2, k] = value[2]
        if image_pixels.shape[1] == 4:
            image_pixels[tile, 3, k] = value[3]
