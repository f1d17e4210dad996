"""Colours of a partition by least squares: those that explain the pixels of its image best."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints
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
    image, least = regions.image, ROUNDING + regions.noise
    known, count = np.array([coloring.color for coloring in partition.colorings]), len(partition.colorings)
    flat = np.array([c.ramp is None and not c.is_band for c in partition.colorings], np.bool_)
    height, width = image.shape[:2]
    cells = _by_pixel(partition.paint[partition.labels], height, width)
    is_mixed = (cells != cells[:, :1]).any(axis=1)
    pure, shown = cells[~is_mixed, 0], image.reshape(-1, 4).astype(np.float64)
    mixed, cells = np.flatnonzero(is_mixed), cells[is_mixed]
    # What gradients show is known.
    fills = _by_pixel(partition.fills, height, width)[mixed]
    rest = shown[mixed] - (fills * ~flat[cells][..., None]).mean(axis=1)
    keys, counts = np.unique(np.arange(len(cells))[:, None] * count + cells, return_counts=True)
    (pixel, paint), area = np.divmod(keys, count), counts / cells.shape[1]
    goal = _sums(pure, shown[~is_mixed], count) + _sums(paint, area[:, None] * rest[pixel], count)
    inner = np.bincount(pure, minlength=count)
    weight = inner + np.bincount(paint, area * area, count)
    one, other, product = _products(pixel, paint, area, count)
    first, colors = np.searchsorted(one, np.arange(count + 1)), np.where(flat[:, None], known, 0.0)
    for _ in range(SWEEPS):
        for k in np.flatnonzero(flat & (weight > 0)).tolist():
            own = slice(first[k], first[k + 1])
            beside = (product[own, None] * colors[other[own]]).sum(axis=0)
            colors[k] = np.clip((goal[k] - beside) / weight[k], 0, 255)

    def error(colors: Floats) -> Floats:
        """Return the squared error of the pixels of each colouring, by the areas in which they show it."""
        whole = np.square(shown[~is_mixed] - colors[pure]).sum(axis=1)
        model = _sums(pixel, area[:, None] * colors[paint], len(mixed))
        mix = np.square(rest - model).sum(axis=1)
        return np.asarray(np.bincount(pure, whole, count) + np.bincount(paint, area * mix[pixel], count))

    before = np.where(flat[:, None], known, 0.0)
    changed = flat & (error(colors) < error(before) / 2) & (np.abs(colors - before).max(axis=1) > least)
    if not changed.any():
        return partition
    colorings = [
        replace(coloring, color=np.round(colors[k]).astype(coloring.color.dtype)) if changed[k] else coloring
        for k, coloring in enumerate(partition.colorings)
    ]
    return replace(partition, colorings=colorings)


def _products(pixel: Ints, paint: Ints, area: Floats, count: int) -> tuple[Ints, Ints, Floats]:
    """Return pairs of colourings in one pixel, in order, and the sums of the products of their areas."""
    pairs, products = [np.zeros(0, np.intp)], [np.zeros(0)]
    step = 1
    while len(first := np.flatnonzero(pixel[step:] == pixel[: len(pixel) - step])):
        last = first + step
        pairs += [paint[first] * count + paint[last], paint[last] * count + paint[first]]
        products += [area[first] * area[last]] * 2
        step += 1
    found, which = np.unique(np.concatenate(pairs), return_inverse=True)
    one, other = np.divmod(found, count)
    return one, other, np.asarray(np.bincount(which, np.concatenate(products), len(found)), np.float64)


def _by_pixel(cells: Any, height: int, width: int) -> Any:
    """Return values of cells (row, column, ...) as those of pixels, shape (pixel, cell, ...)."""
    scale, rest = len(cells) // height, cells.shape[2:]
    cells = cells.reshape(height, scale, width, scale, *rest).swapaxes(1, 2)
    return cells.reshape(height * width, scale * scale, *rest)


def _sums(which: Ints, values: Floats, count: int) -> Floats:
    """Return the sum of the values (n, channel) of each of ``count`` things, (count, channel)."""
    return np.stack([np.bincount(which, channel, count) for channel in values.T], axis=1)
