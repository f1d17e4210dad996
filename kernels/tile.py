"""Tiles as vectors: neighbouring pixels of a tile, one below the other, are one value.

Compositing is then arithmetic with vectors. How long they are is a parameter of the kernels, which are made
when they are needed: a CPU's have the 16 pixels of a tile's column, one or two instructions for each
operation; a GPU's have 4, so that their threads, one a vector, have few registers and read what lies side by
side in memory. The memory is the same: [.., 16 x column + row] as [.., vector].
"""

from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


tile_column: Any = wp.types.vector(length=constants.TILE, dtype=wp.float32)
quad: Any = wp.types.vector(length=constants.QUAD, dtype=wp.float32)


@wp.func
def total(v: tile_column) -> wp.float32:
    """Return the sum of the elements, as a tree: the same bits everywhere."""
    even = ((v[0] + v[8]) + (v[4] + v[12])) + ((v[2] + v[10]) + (v[6] + v[14]))
    odd = ((v[1] + v[9]) + (v[5] + v[13])) + ((v[3] + v[11]) + (v[7] + v[15]))
    return even + odd


@wp.func
def total(v: quad) -> wp.float32:  # noqa: F811
    """Return the sum of four elements."""
    return (v[0] + v[2]) + (v[1] + v[3])
