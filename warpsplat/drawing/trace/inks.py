"""Inks: the colours of thin parts, of which no pixel may be covered altogether."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing import prices
from warpsplat.drawing.trace.grids import (
    NO_REGION,
    Bools,
    Floats,
    Ints,
    bounding_boxes,
    channel_max,
    components,
    dilated,
)
from warpsplat.drawing.trace.mixtures import MIXED, REACH, mixed, neighbours
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.regions import Regions
from warpsplat.portable import filters
from warpsplat.scene.scene import numbers_in

ALONG = 5  # [px] side of the square within which thin parts have one ink
STEP = 16  # [levels] between colours of thin parts that are tried as inks
TRIED = 48  # of them, the most frequent ones
LEAST_INK = 0.4  # share of an ink in a colour that is taken for a mixture with it
SOLID = 40  # [px] in a row or area of one colour that is no mixture
DARKEST = 3  # pixels whose median is the ink


def with_inks(regions: Regions) -> Regions:
    """Return clean regions with one ink for all thin parts that show more or less of it.

    More inks are added where they explain the thin parts of the whole picture so much better that they are
    worth their bytes: lines of several colours that touch are one part.
    """
    painted = regions.paint[regions.labels]
    flat = [k for k in numbers_in(painted).tolist() if regions.colorings[k].ramp is None]
    colors = {k: regions.colorings[k].color for k in flat}
    solid = sorted(set(flat) & _solid(regions, painted))
    if not solid or len(solid) == len(flat):
        return regions
    bases, numbers = {}, numbers_in(painted)
    boxes = bounding_boxes(np.searchsorted(numbers, painted), len(numbers))
    for k, box in zip(numbers.tolist(), boxes, strict=True):
        if k not in colors or k in solid:
            continue
        around = box.grown(2).slices()
        own = painted[around] == k
        beside = painted[around][dilated(own, 5) & ~own]
        bases[k] = base = colors[solid[np.bincount(beside, minlength=len(regions.colorings))[solid].argmax()]]
        toward = colors[k] - base
        pixels = regions.image[around][own]
        share = ((pixels - base) * toward).sum(axis=1) / max(float((toward**2).sum()), 1.0)
        off = channel_max(np.abs(pixels - base - share[:, None] * toward))
        # What is more of a colour than the usual one is off by as much more.
        near = off <= np.maximum(share, 1) * (1 + regions.noise)
        pixels = pixels[near] if near.any() else pixels
        order = np.argsort(-((pixels - base) ** 2).sum(axis=1), kind="stable")
        colors[k] = np.round(np.median(pixels[order[:DARKEST]], axis=0))
    paint, colorings, inks = regions.paint.copy(), list(regions.colorings), list(solid)
    for k in sorted(bases, key=lambda k: (-float(((colors[k] - bases[k]) ** 2).sum()), k)):
        share, off = mixed(colors[k], np.array([colors[j] for j in inks]), bases[k])
        off = np.where(share >= LEAST_INK, off, np.inf)
        if off.min() <= MIXED:
            paint[regions.paint == k] = inks[off.argmin()]
        else:
            inks.append(k)
            colorings[k] = replace(colorings[k], color=colors[k])
    return _with_more_inks(
        _painted(regions, paint[regions.labels], colorings), np.isin(painted, sorted(bases))
    )


def _painted(regions: Regions, painted: Ints, colorings: list[Coloring]) -> Regions:
    """Return regions by the colouring of each pixel; gradients stay where they are."""
    labels, paint = components(painted, regions.image)
    flat = np.array([coloring.ramp is None for coloring in colorings])[painted]
    fills = regions.fills.copy()
    fills[flat] = np.array([coloring.color for coloring in colorings])[painted[flat]]
    return replace(regions, labels=labels, paint=paint, fills=fills, colorings=colorings)


def _with_more_inks(regions: Regions, where: Bools) -> Regions:
    """Return regions whose thin parts, which are ``where``, have more inks if these are worth their bytes."""
    painted, shown = regions.paint[regions.labels], regions.image[where]
    owners, bases = _beside(regions, painted, where)

    def errors(ink: Floats) -> Floats:
        """Return the squared error of each pixel as a mixture of an ink and what is beside."""
        error, pixels = ((shown - ink) ** 2).sum(axis=1), shown[owners]
        share = np.clip(mixed(pixels, ink, bases)[0], 0, 1)
        np.minimum.at(error, owners, ((pixels - bases - share[:, None] * (ink - bases)) ** 2).sum(axis=1))
        return error

    def along(values: Floats) -> Floats:
        """Return the sums of values near each pixel."""
        grid = np.zeros(where.shape, np.float64)
        grid[where] = values
        return filters.box_sum(grid, ALONG)[where]

    tried, own = _usual_colors(shown), painted[where]
    after, left = [errors(ink) for ink in tried], np.zeros(len(own))
    for k in numbers_in(own).tolist():
        left[own == k] = errors(regions.colorings[k].color)[own == k]
    values = 3 * where.size * 255.0**2
    while True:
        best = max(range(len(tried)), key=lambda i: float(np.maximum(left - after[i], 0).sum()))
        is_nearer = along(after[best]) < along(left)
        painted[where] = np.where(is_nearer, len(regions.colorings), painted[where])
        found = _painted(regions, painted, [*regions.colorings, Coloring(np.round(tried[best]))])
        more, size = len(found.paint) - len(regions.paint), max(len(found.paint), len(regions.paint))
        byte = prices.worth(float(left.sum()) / values, prices.REGION * size)
        gain = float((left - after[best])[is_nearer].sum()) / values
        if gain <= prices.REGION * max(more, 1) * byte:
            return regions
        regions, left = found, np.where(is_nearer, after[best], left)


def _beside(regions: Regions, painted: Ints, where: Bools) -> tuple[Ints, Floats]:
    """Return the colours of what is beside thin parts, (base, channel), and the pixel that each is beside."""
    rows, columns = np.nonzero(where)
    found, index, _ = neighbours(np.where(where, NO_REGION, painted), rows, columns, REACH)
    known = found != NO_REGION
    pixel = np.nonzero(known)[1]
    first = np.unique(pixel * len(regions.colorings) + found[known], return_index=True)[1]
    return pixel[first], regions.fills.reshape(-1, regions.fills.shape[2])[index[known][first]]


def _usual_colors(shown: Floats) -> Floats:
    """Return the most frequent ones among colours (pixel, channel), about, shape (color, channel)."""
    _, owner, counts = np.unique(np.round(shown / STEP), axis=0, return_inverse=True, return_counts=True)
    usual = np.argsort(-counts, kind="stable")[:TRIED].tolist()
    return np.array([shown[owner.reshape(-1) == i].mean(axis=0) for i in usual])


def _solid(regions: Regions, painted: Ints) -> set[int]:
    """Return the colourings that cover an area, or a line as long as no letter's."""
    is_exact = channel_max(np.abs(regions.image - regions.fills)) <= MIXED
    exact = np.where(is_exact, painted, NO_REGION)
    around = np.pad(exact, 1, mode="edge")
    height, width = exact.shape
    inner = [(around[y : y + height, x : x + width] == exact) for y, x in np.ndindex(3, 3)]
    labels, values = components(exact, regions.image)
    long = values[np.bincount(labels.reshape(-1)) >= SOLID]
    return {*numbers_in(exact[is_exact & np.logical_and.reduce(inner)]).tolist(), *long.tolist()} - {
        NO_REGION
    }
