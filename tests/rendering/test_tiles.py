from __future__ import annotations

import numpy as np

from warpsplat.kernels.constants import TILE
from warpsplat.rendering.tiles import from_tiles, to_tiles


def test_tiles_and_back() -> None:
    image = np.random.default_rng(0).uniform(size=(37, 50, 3)).astype(np.float32)
    tiles = to_tiles(image)
    assert tiles.shape == (4 * 3, 3, TILE, TILE)
    assert tiles[4 + 1, 2, 5, 3] == image[16 + 3, 16 + 5, 2]
    np.testing.assert_array_equal(from_tiles(tiles, 50, 37), image)
