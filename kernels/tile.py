"""Tiles as vectors: a column of a tile's 16 pixels is one value.

Compositing and prefix sums along x are then vector operations. A CPU does each with one or two instructions;
a GPU gives each column of a tile a thread.
"""

from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

column: Any = wp.types.vector(length=constants.TILE, dtype=wp.float32)


@wp.func
def total(v: column) -> wp.float32:
    """Return the sum of the elements, as a tree: the same bits everywhere."""
    even = ((v[0] + v[8]) + (v[4] + v[12])) + ((v[2] + v[10]) + (v[6] + v[14]))
    odd = ((v[1] + v[9]) + (v[5] + v[13])) + ((v[3] + v[11]) + (v[7] + v[15]))
    return even + odd
