"""Images <-> tiles: [tile, channel, column, row], padded to whole tiles."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpsplat.kernels import constants
from warpsplat.scene import FloatArray

TILE = constants.TILE


def tile_counts(width: int, height: int) -> tuple[int, int]:
    """Return the number of tiles in a row and in a column of an image."""
    return -(-width // TILE), -(-height // TILE)


def to_tiles(image: FloatArray) -> FloatArray:
    """Convert shape (height, width, channels) to (tiles, channels, TILE, TILE); the padding is 0."""
    height, width, channels = image.shape
    across, down = tile_counts(width, height)
    padded = np.zeros((down * TILE, across * TILE, channels), np.float32)
    padded[:height, :width] = image
    blocks = padded.reshape(down, TILE, across, TILE, channels).transpose(0, 2, 4, 3, 1)
    return np.ascontiguousarray(blocks).reshape(down * across, channels, TILE, TILE)


def from_tiles(tiles: FloatArray, width: int, height: int) -> FloatArray:
    """Convert back: the inverse of ``to_tiles``."""
    across, down = tile_counts(width, height)
    channels = tiles.shape[1]
    blocks = tiles.reshape(down, across, channels, TILE, TILE).transpose(0, 4, 1, 3, 2)
    return np.ascontiguousarray(blocks.reshape(down * TILE, across * TILE, channels)[:height, :width])


def read_tiles(columns: wp.array) -> FloatArray:
    """Return an array of vectors of pixels, shape (..., columns), as tiles on the host, (..., TILE, TILE)."""
    return np.asarray(columns.numpy(), np.float32).reshape(*columns.shape[:-1], TILE, TILE)


def write_tiles(columns: wp.array, tiles: FloatArray) -> None:
    """Assign tiles, shape (..., TILE, TILE), to an array of vectors of pixels, shape (..., columns)."""
    columns.assign(tiles.reshape(*columns.shape, -1))
