"""Fewer regions: those that are seen least become part of the neighbour most like them."""

from __future__ import annotations

import heapq
from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints, Sets
from warpsplat.drawing.trace.regions import Regions


def fewer_regions(regions: Regions, most: int) -> Regions:
    """Merge regions, the pair that changes the picture least first, until there are no more than ``most``."""
    count = len(regions.paint)
    if count <= most:
        return regions
    sizes = np.bincount(regions.labels.reshape(-1), minlength=count).astype(np.float64)
    colors = np.array([coloring.color for coloring in regions.colorings])[regions.paint]
    merged = _merge(_neighbours(regions.labels), sizes, colors, most)
    numbers = np.unique(merged, return_inverse=True)[1]
    labels = numbers[regions.labels].astype(np.int32)
    paint = np.zeros(int(numbers.max()) + 1, np.int32)
    paint[numbers[merged]] = regions.paint[merged]
    changed = (merged != np.arange(count))[regions.labels]
    pure = regions.pure.copy()
    pure[changed] = colors[merged][regions.labels[changed]]
    return replace(regions, labels=labels, paint=paint, pure=pure)


def _neighbours(labels: Ints) -> list[set[int]]:
    count = int(labels.max()) + 1
    pairs = np.concatenate(
        [
            np.stack([labels[:, 1:].reshape(-1), labels[:, :-1].reshape(-1)], axis=1),
            np.stack([labels[1:].reshape(-1), labels[:-1].reshape(-1)], axis=1),
        ]
    ).astype(np.int64)
    keys = np.unique(pairs[:, 0] * count + pairs[:, 1])
    beside: list[set[int]] = [set() for _ in range(count)]
    for a, b in zip((keys // count).tolist(), (keys % count).tolist(), strict=True):
        if a != b:
            beside[a].add(b)
            beside[b].add(a)
    return beside


def _merge(beside: list[set[int]], sizes: Floats, colors: Floats, most: int) -> Ints:
    """The region whose colour each region has in the end."""
    count = len(beside)
    sets, size = Sets(count), sizes.tolist()

    def cheapest(region: int) -> tuple[float, int] | None:
        near = list(beside[region])
        if not near:
            return None
        costs = size[region] * ((colors[near] - colors[region]) ** 2).sum(axis=1)
        best = int(costs.argmin())
        return float(costs[best]), near[best]

    heap = []
    for region in range(count):
        found = cheapest(region)
        if found:
            heap.append((found[0], region, found[1], size[region]))
    heapq.heapify(heap)
    left, gone = count, [False] * count
    while left > most and heap:
        _, region, into, known = heapq.heappop(heap)
        if gone[region]:
            continue
        if gone[into] or known != size[region]:
            found = cheapest(region)
            if found:
                heapq.heappush(heap, (found[0], region, found[1], size[region]))
            continue
        gone[region] = True
        left -= 1
        size[into] += size[region]
        for other in beside[region]:
            beside[other].discard(region)
            if other != into:
                beside[other].add(into)
                beside[into].add(other)
        sets.join(region, into)
    stayed = {sets.find(region): region for region in range(count) if not gone[region]}
    return np.asarray([stayed[sets.find(region)] for region in range(count)], np.int64)
