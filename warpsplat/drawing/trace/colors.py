"""Colours of a partition by least squares: those that explain the pixels of its image best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Floats
from warpsplat.drawing.trace.partition import Partition
from warpsplat.drawing.trace.regions import Regions
from warpsplat.drawing.trace.seeds import ROUNDING
from warpsplat.drawing.trace.shares import colors_at

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
    painted = partition.painted
    cells = painted.blocks.reshape(-1, partition.scale**2)
    # A block whose cells are alike is as pure as a pixel that is whole; blocks of the frame show nothing.
    pure = painted.pixels.copy()
    is_mixed = (cells != cells[:, :1]).any(axis=1)
    pure[painted.block >= 0] = np.where(is_mixed, NO_REGION, cells[:, 0])
    pure = pure[1:-1, 1:-1]
    rows, columns = (each[is_mixed] // partition.scale for each in painted.corners)
    cells = cells[is_mixed]
    left = regions.image[rows, columns].astype(np.float64)
    at = np.broadcast_arrays(rows[:, None], columns[:, None], cells)[:2]
    left -= colors_at(regions, cells, *at).mean(axis=1, dtype=np.float64)
    whole = [channel[pure >= 0].astype(np.float64) for channel in np.moveaxis(regions.image, 2, 0)]
    pure = pure[pure >= 0]
    # The area of each colouring in each mixed pixel where it is.
    keys, counts = np.unique(
        cells.astype(np.int64) * len(cells) + np.arange(len(cells))[:, None], return_counts=True
    )
    paint, pixel = np.divmod(keys, max(len(cells), 1))
    area, first = counts / cells.shape[1], np.searchsorted(paint, np.arange(count + 1))
    inner = np.bincount(pure, minlength=count)
    weight = inner + np.bincount(paint, area * area, count)
    sums = np.stack([np.bincount(pure, channel, count) for channel in whole], axis=1)
    squares = sum(np.bincount(pure, channel * channel, count) for channel in whole)

    def error(colors: Floats) -> Floats:
        """Return the squared error of the pixels of each colouring, by the areas in which they show it."""
        of_pure = squares + (colors * (inner[:, None] * colors - 2 * sums)).sum(axis=1)
        return np.asarray(of_pure + np.bincount(paint, area * np.square(left).sum(axis=1)[pixel], count))

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
