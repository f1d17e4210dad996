"""Which region lies under which: a tree of what is inside of what, and among neighbours what their outlines
say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.trace.grids import NOBODY, Bools, Floats, Ints
from warpsplat.trace.planar import STEPS, Loops

LOOK = 6
"""Cracks over which the direction of an outline is taken where regions meet."""

STRAIGHT = 0.85
"""Cosine from which on an outline goes straight on there."""

SIBLINGS = 400
"""Neighbours that are put in order by their outlines; more are by size."""


@dataclass(frozen=True)
class Layers:
    """The order of painting."""

    rank: Ints
    """Of each region: higher is painted later; -1 for those that are not painted. Shape (region,)."""
    order: Ints
    """The painted regions from the back on."""


def find_layers(loops: Loops, sizes: Ints, unpainted: Bools) -> Layers:
    """Put the regions in order.

    Args:
        loops: of all regions.
        sizes: pixels of each region, shape (region,).
        unpainted: regions that lie below all others and are left out, shape (region,).
    """
    children = _tree(loops, len(sizes))
    votes = _votes(loops, unpainted)
    order: list[int] = []
    waiting = [NOBODY]
    while waiting:
        region = waiting.pop()
        if region != NOBODY and not unpainted[region]:
            order.append(region)
        for siblings in children.get(region, []):
            waiting.extend(reversed(_sorted(siblings, votes, sizes)))
    rank = np.full(len(sizes), -1, np.int64)
    rank[order] = np.arange(len(order))
    return Layers(rank, np.asarray(order, np.int64))


def _tree(loops: Loops, count: int) -> dict[int, list[list[int]]]:
    """For each region the networks of regions that lie in its holes."""
    outer = {}
    inside: dict[int, list[int]] = {}
    for loop in range(len(loops)):
        region, network = int(loops.region[loop]), int(loops.network[loop])
        # What is outside of the picture has its loop around the picture, as a hole of it.
        if loops.is_hole[loop]:
            outer[network] = region
        else:
            inside.setdefault(network, []).append(region)
    tree: dict[int, list[list[int]]] = {}
    for network, regions in inside.items():
        tree.setdefault(outer.get(network, NOBODY), []).append(regions)
    return tree


def _votes(loops: Loops, unpainted: Bools) -> dict[int, dict[int, float]]:
    """``votes[a][b]``: how surely region a lies above region b. Where three meet, the one whose outline goes
    straight on lies above the other two.
    """
    votes: dict[int, dict[int, float]] = {}
    for loop in range(len(loops)):
        region = int(loops.region[loop])
        if region == NOBODY or unpainted[region]:
            continue
        low, high = int(loops.first[loop]), int(loops.first[loop + 1])
        others, size = loops.others[low:high], high - low
        changes = np.flatnonzero(others != np.roll(others, 1))
        if not len(changes):
            continue
        steps = STEPS[loops.ways[low:high]]
        look = min(LOOK, size // 4)
        window = np.arange(max(1, look))[:, None]
        ahead = steps[(changes + window) % size].sum(axis=0)
        behind = steps[(changes - 1 - window) % size].sum(axis=0)
        lengths = np.hypot(*ahead.T) * np.hypot(*behind.T)
        cosines = (ahead * behind).sum(axis=1) / np.maximum(lengths, 1e-6)
        for change, cosine in zip(changes.tolist(), cosines.tolist(), strict=True):
            if cosine >= STRAIGHT:
                below = votes.setdefault(region, {})
                for other in (int(others[change]), int(others[change - 1])):
                    below[other] = below.get(other, 0.0) + 1.0
    return votes


def _sorted(siblings: list[int], votes: dict[int, dict[int, float]], sizes: Ints) -> list[int]:
    """From the back on."""
    by_size = sorted(siblings, key=lambda region: -int(sizes[region]))
    if len(by_size) > SIBLINGS or len(by_size) < 2:
        return by_size
    index = {region: i for i, region in enumerate(by_size)}
    above: Floats = np.zeros((len(by_size), len(by_size)))
    for region in by_size:
        for other, weight in votes.get(region, {}).items():
            if other in index:
                above[index[region], index[other]] += weight
    net = above - above.T
    left = list(range(len(by_size)))
    result = []
    while left:
        part = net[np.ix_(left, left)]
        # The next from the back has the least above-ness over all the others that are left.
        result.append(left.pop(int(np.argmin(np.maximum(part, 0).sum(axis=1)))))
    return [by_size[i] for i in result]
