"""Fewer regions: the least visible ones are merged into the most similar neighbour."""

from __future__ import annotations

import heapq
import math
from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints, Sets
from warpsplat.drawing.trace.regions import Regions
from warpsplat.fit.rounding import byte_worth

LEAST_ERROR = 3e-5
"""Mean squared error of a drawing without noise, sRGB in [0, 1]: 45 dB."""


def fewer_regions(regions: Regions, most: int) -> Regions:
    """Merge regions, the pair that changes the image least first, until there are no more than ``most``."""
    return regions if len(regions.paint) <= most else _merged(regions, most, math.inf)


def worthwhile_regions(regions: Regions, price: float) -> Regions:
    """Merge regions that show less than their bytes are worth beyond the usual ``price`` of 1.

    All regions are taken to need as many bytes, so that no size has to be known.
    """
    if price <= 1:
        return regions
    count, pixels = len(regions.paint), regions.labels.size
    error = max(3 * 255**2 * LEAST_ERROR, 3 * regions.noise**2)
    return _merged(regions, 1, (price - 1) * byte_worth(error * pixels, count))


def _merged(regions: Regions, most: int, dearest: float) -> Regions:
    """Merge regions until ``most`` are left, or a merge would add a squared error above ``dearest``."""
    count = len(regions.paint)
    sizes = np.bincount(regions.labels.reshape(-1), minlength=count).tolist()
    colors = np.array([coloring.color for coloring in regions.colorings])[regions.paint]
    merged = _merge(_neighbours(regions.labels), sizes, colors, most, dearest)
    numbers = np.unique(merged, return_inverse=True)[1]
    labels = numbers[regions.labels].astype(np.int32)
    paint = np.zeros(int(numbers.max()) + 1, np.int32)
    paint[numbers[merged]] = regions.paint[merged]
    changed = (merged != np.arange(count))[regions.labels]
    fills = regions.fills.copy()
    fills[changed] = colors[merged][regions.labels[changed]]
    return replace(regions, labels=labels, paint=paint, fills=fills)


def _neighbours(labels: Ints) -> list[set[int]]:
    count = int(labels.max()) + 1
    first = np.concatenate([labels[:, 1:].reshape(-1), labels[1:].reshape(-1)]).astype(np.int64)
    second = np.concatenate([labels[:, :-1].reshape(-1), labels[:-1].reshape(-1)])
    keys = np.unique(first * count + second)
    beside: list[set[int]] = [set() for _ in range(count)]
    for a, b in zip((keys // count).tolist(), (keys % count).tolist(), strict=True):
        if a != b:
            beside[a].add(b)
            beside[b].add(a)
    return beside


def _merge(beside: list[set[int]], sizes: list[int], colors: Floats, most: int, dearest: float) -> Ints:
    """Return for each region the one that it is merged into, or itself.

    Args:
        beside: The neighbours of each region; changed in place.
        sizes: Pixels of each region; changed in place.
        colors: Shape (region, 4).
        most: Regions that are to be left.
        dearest: Squared error that a merge may add [levels squared].
    """
    count = len(beside)
    sets = Sets(count)
    heap: list[tuple[float, int, int, int]] = []  # cost, region, neighbour, size of the region at the time

    def push(region: int) -> None:
        """Queue the merge of a region into the neighbour that it costs least."""
        if beside[region]:
            near = list(beside[region])
            costs = sizes[region] * ((colors[near] - colors[region]) ** 2).sum(axis=1)
            best = int(costs.argmin())
            heapq.heappush(heap, (float(costs[best]), region, near[best], sizes[region]))

    for region in range(count):
        push(region)
    left, gone = count, [False] * count
    while left > most and heap:
        cost, region, into, size = heapq.heappop(heap)
        if cost > dearest:
            break
        if gone[region]:
            continue
        if gone[into] or size != sizes[region]:
            push(region)
            continue
        gone[region] = True
        left -= 1
        sizes[into] += sizes[region]
        for other in beside[region]:
            beside[other].discard(region)
            if other != into:
                beside[other].add(into)
                beside[into].add(other)
        sets.join(region, into)
    stayed = {sets.find(region): region for region in range(count) if not gone[region]}
    return np.asarray([stayed[sets.find(region)] for region in range(count)], np.int64)
