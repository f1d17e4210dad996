"""Fewer regions: the least visible ones are merged into the most similar neighbour."""

from __future__ import annotations

import heapq
from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.drawing.trace.label_map import LabelMap
from warpsplat.drawing.trace.nesting import shared_borders
from warpsplat.drawing.trace.palette import least_worth
from warpsplat.drawing.trace.regions import Regions


def fewer_regions(regions: Regions, most: int, price: float = 1.0) -> Regions:
    """Merge regions, the pair that changes the image least first.

    Args:
        regions: All take as many bytes, so that no size has to be known.
        most: Regions that are left at the most.
        price: Of a byte, over its usual one: regions that show less than their bytes are worth go too.
    """
    count = len(regions.paint)
    dearest = least_worth(count, regions.labels.size, regions.noise, price=price)
    beside: list[set[int]] = [set() for _ in range(count)]
    for a, b in shared_borders(LabelMap.of(regions.labels), count):
        beside[a].add(b)
        beside[b].add(a)
    sizes = np.bincount(regions.labels.reshape(-1), minlength=count).tolist()
    colors = np.array([coloring.color for coloring in regions.colorings])[regions.paint]
    merged = _merge(beside, sizes, colors, most, dearest)
    left, numbers = np.unique(merged, return_inverse=True)
    labels = numbers[regions.labels].astype(np.int32)
    changed = (merged != np.arange(count))[regions.labels]
    fills = regions.fills.copy()
    fills[changed] = colors[merged][regions.labels[changed]]
    return replace(regions, labels=labels, paint=regions.paint[left], fills=fills)


def _merge(beside: list[set[int]], sizes: list[int], colors: Floats, most: int, dearest: float) -> Ints:
    """Return for each region the one that it is merged into, or itself.

    Args:
        beside: The neighbours of each region; changed in place.
        sizes: Pixels of each region; changed in place.
        colors: Shape (region, 4).
        most: Regions that are to be left.
        dearest: Squared error that a merge may add if there are no more [levels squared].
    """
    left, merged, sums = len(beside), np.arange(len(beside)), colors * np.array(sizes)[:, None]
    heap: list[tuple[float, int, int, int]] = []  # cost, region, neighbour, size of the region at the time

    def push(region: int) -> None:
        """Queue the merge of a region into the neighbour that it costs least."""
        if beside[region]:
            near = list(beside[region])
            # Pixels that it took from others are of their own colours still.
            change = colors[near] - colors[region]
            middle = (colors[near] + colors[region]) * (sizes[region] / 2)
            costs = 2 * (change * (middle - sums[region])).sum(axis=1)
            best = int(costs.argmin())
            heapq.heappush(heap, (float(costs[best]), region, near[best], sizes[region]))

    for region in range(left):
        push(region)
    while heap and left > 1:
        cost, region, into, size = heapq.heappop(heap)
        if left <= most and cost > dearest:
            break
        if merged[region] != region:
            continue
        if merged[into] != into or size != sizes[region]:
            push(region)
            continue
        merged[region] = into
        left -= 1
        sizes[into] += sizes[region]
        sums[into] += sums[region]
        for other in beside[region]:
            beside[other].discard(region)
            if other != into:
                beside[other].add(into)
                beside[into].add(other)
    while (merged != merged[merged]).any():
        merged = merged[merged]
    return merged
