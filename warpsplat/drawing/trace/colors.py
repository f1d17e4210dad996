"""Colours of a partition by least squares: those that explain the pixels of its image best."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.drawing.trace.partition import Partition
from warpsplat.drawing.trace.regions import Regions
from warpsplat.drawing.trace.seeds import ROUNDING

SWEEPS = 8  # over all colours, each of which is the best one beside the others


def with_best_colors(partition: Partition, regions: Regions) -> Partition:
    """Return a partition with the flat colours of least squares where these halve the error of their pixels.

    The colour of an area is seen, but no pixel may show that of a pen or a pencil. Cells that are pixels do
    not tell what these are mixed of.
    """
    if partition.scale == 1:
        return partition
    known, count = np.array([c.color for c in partition.colorings], np.float64), len(partition.colorings)
    flat = np.array([c.ramp is None and not c.is_band for c in partition.colorings], np.bool_)
    height, width = regions.image.shape[:2]
    shown = regions.image.reshape(-1, 4).astype(np.float64)
    cells = _by_pixel(partition.paint[partition.labels], height, width)
    is_mixed = (cells != cells[:, :1]).any(axis=1)
    pure, whole = cells[~is_mixed, 0], shown[~is_mixed]
    cells, left = cells[is_mixed], shown[is_mixed]
    left -= _by_pixel(partition.fills, height, width)[is_mixed].mean(axis=1, dtype=np.float64)
    # The area of each colouring in each mixed pixel where it is.
    keys, counts = np.unique(
        cells.astype(np.int64) * len(cells) + np.arange(len(cells))[:, None], return_counts=True
    )
    paint, pixel = np.divmod(keys, max(len(cells), 1))
    area, first = counts / cells.shape[1], np.searchsorted(paint, np.arange(count + 1))
    inner = np.bincount(pure, minlength=count)
    weight = inner + np.bincount(paint, area * area, count)
    sums = np.stack([np.bincount(pure, channel, count) for channel in whole.T], axis=1)

    def error(colors: Floats) -> Floats:
        """Return the squared error of the pixels of each colouring, by the areas in which they show it."""
        off, mixed = (np.square(each).sum(axis=1) for each in (whole - colors[pure], left))
        return np.asarray(np.bincount(pure, off, count) + np.bincount(paint, area * mixed[pixel], count))

    before, colors = error(known), known.copy()
    for _ in range(SWEEPS):
        for k in np.flatnonzero(flat & (weight > 0)).tolist():
            own = slice(first[k], first[k + 1])
            share = area[own, None]
            lack = sums[k] - inner[k] * colors[k] + (share * left[pixel[own]]).sum(axis=0)
            color = np.clip(colors[k] + lack / weight[k], 0, 255)
            left[pixel[own]] -= share * (color - colors[k])
            colors[k] = color
    is_off = np.abs(colors - known).max(axis=1) > ROUNDING + regions.noise
    changed = flat & is_off & (error(colors) < before / 2)
    if not changed.any():
        return partition
    colorings = [
        replace(coloring, color=np.round(colors[k]).astype(coloring.color.dtype)) if changed[k] else coloring
        for k, coloring in enumerate(partition.colorings)
    ]
    return replace(partition, colorings=colorings)


def _by_pixel(cells: Any, height: int, width: int) -> Any:
    """Return values of cells (row, column, ...) as those of pixels, shape (pixel, cell, ...)."""
    scale, rest = len(cells) // height, cells.shape[2:]
    cells = cells.reshape(height, scale, width, scale, *rest).swapaxes(1, 2)
    return cells.reshape(height * width, scale * scale, *rest)
