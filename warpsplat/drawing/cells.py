"""Small squares of the canvas: what a change of an outline may change in the image.

A set of them is an array of ascending integers.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.trace.beziers import points_at
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.tiles import TILE

Cells = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

CELL_SIDE = 2  # [canvas units] side of a cell, which divides that of a tile

ORIGIN = 1 << 20
ROW_SPAN = 2 * ORIGIN
"""A cell's number is (column + ORIGIN) ROW_SPAN + row + ORIGIN: outlines stay within ten canvases."""

BESIDE = np.arange(-1, 2)
CELL_OFFSETS = np.add.outer(BESIDE * ROW_SPAN, BESIDE).ravel()
"""Offsets of a cell and its neighbours, which an outline in it may change as well."""


def columns_and_rows(cells: Cells) -> tuple[Cells, Cells]:
    """Return the columns and rows of cells."""
    return cells // ROW_SPAN - ORIGIN, cells % ROW_SPAN - ORIGIN


def joined(sets: Sequence[Cells]) -> Cells:
    """Return the union of sets of cells."""
    return sets[0] if len(sets) == 1 else np.unique(np.concatenate(sets))


def cells_around(cubics: Floats) -> list[Cells]:
    """Return the cells around each of some cubics, shape (cubic, 4, 2)."""
    if not len(cubics):
        return []
    reach = np.linalg.norm(np.diff(cubics, axis=1), axis=2).sum(axis=1)
    counts = 2 + np.ceil(1.5 * reach / CELL_SIDE).astype(np.intp)
    which = np.repeat(np.arange(len(cubics)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    t = np.minimum(number * (1 / (counts - 1))[which], 1)
    points = points_at(cubics[which], t[:, None])[:, 0]
    places = np.floor(points / CELL_SIDE).astype(np.int64) + ORIGIN
    every = ROW_SPAN * ROW_SPAN
    passed = np.unique(which * every + places[:, 0] * ROW_SPAN + places[:, 1])
    near = np.unique(passed[:, None] + CELL_OFFSETS)
    return np.split(near % every, np.searchsorted(near, np.arange(1, len(cubics)) * every))


def by_cell(tiles: npt.NDArray[np.floating[Any]], viewport: Viewport) -> Floats:
    """Return sums over the cells, with an empty one beyond each border, shape (rows + 2, columns + 2).

    ``tiles``: pixels, 0 beyond the image, shape (tile, column, row).
    """
    side = TILE // CELL_SIDE
    tall = functools.reduce(np.add, [tiles[..., i::CELL_SIDE].astype(np.float64) for i in range(CELL_SIDE)])
    small = functools.reduce(np.add, [tall[:, i::CELL_SIDE] for i in range(CELL_SIDE)])
    blocks = small.reshape(viewport.tiles_y, viewport.tiles_x, side, side).transpose(0, 3, 1, 2)
    sums = blocks.reshape(viewport.tiles_y * side, viewport.tiles_x * side)
    return np.pad(sums[: -(-viewport.height // CELL_SIDE), : -(-viewport.width // CELL_SIDE)], 1)


def sum_within(sums: Floats, cells: Cells) -> float:
    """Return the total of ``by_cell`` over some cells; those beyond the border are empty."""
    columns, rows = columns_and_rows(cells)
    height, width = sums.shape
    return float(sums[np.clip(rows + 1, 0, height - 1), np.clip(columns + 1, 0, width - 1)].sum())
