"""Which region lies under which: a tree of what is inside of what, and among neighbours what their outlines
say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NOBODY, Bools, Floats, Ints
from warpsplat.drawing.trace.planar import STEPS, Loops
from warpsplat.portable.elementary import hypot

LOOK = 6
"""Cracks over which the direction of an outline is taken where regions meet."""

STRAIGHT = 0.85
"""Cosine from which on an outline goes straight on there."""

THIN = 7.0
"""Width of the widest region that is a line [px]."""

SIBLINGS = 400
"""Neighbours that are put in order by their outlines; more are by size."""


@dataclass(frozen=True)
class Tree:
    """What lies in the holes of what."""

    children: dict[int, list[list[int]]]
    """The networks of regions in the holes of each region; those of NOBODY make up the picture."""
    parent: Ints
    """The region in a hole of which each lies; NOBODY for the outermost. Shape (region,)."""
    touches: Bools
    """Whether it has a boundary with its parent, shape (region,)."""

    def downwards(self) -> list[int]:
        """All regions, parents before children."""
        order, waiting = [], [NOBODY]
        while waiting:
            for siblings in self.children.get(waiting.pop(), []):
                order.extend(siblings)
                waiting.extend(siblings)
        return order


def find_tree(loops: Loops, count: int) -> Tree:
    """The tree of ``count`` regions."""
    outer: dict[int, int] = {}
    touching: set[tuple[int, int]] = set()
    inside: dict[int, list[int]] = {}
    for loop in range(len(loops)):
        region, network = int(loops.region[loop]), int(loops.network[loop])
        # What is outside of the picture has its loop around the picture, as a hole of it.
        if loops.is_hole[loop]:
            outer[network] = region
            others = loops.others[loops.first[loop] : loops.first[loop + 1]]
            touching |= {(int(other), region) for other in np.unique(others)}
        else:
            inside.setdefault(network, []).append(region)
    children: dict[int, list[list[int]]] = {}
    parent = np.full(count, NOBODY, np.int64)
    for network, regions in inside.items():
        around = outer.get(network, NOBODY)
        children.setdefault(around, []).append(regions)
        parent[regions] = around
    touches = np.array([(region, int(parent[region])) in touching for region in range(count)], np.bool_)
    return Tree(children, parent, touches)


def bare_ground(tree: Tree, like_ground: Bools) -> Bools:
    """Which regions of the ground's colour need no paint: nothing that is painted lies under them."""
    bare = np.zeros(len(like_ground), np.bool_)
    for region in tree.downwards():
        around = int(tree.parent[region])
        if not like_ground[region]:
            continue
        if around == NOBODY or bare[around]:
            bare[region] = True
        elif tree.touches[region]:
            beyond = int(tree.parent[around])
            bare[region] = beyond == NOBODY or bare[beyond]
    return bare


def over_clear(tree: Tree, clear: Bools) -> Bools:
    """Regions that have something clear inside of them."""
    found = clear.copy()
    for region in reversed(tree.downwards()):
        if found[region] and tree.parent[region] != NOBODY:
            found[tree.parent[region]] = True
    return np.asarray(found)


@dataclass(frozen=True)
class Layers:
    """The order of painting."""

    rank: Ints
    """Of each region: higher is painted later; -1 for those that are not painted. Shape (region,)."""
    order: Ints
    """The painted regions from the back on."""


def find_layers(loops: Loops, tree: Tree, sizes: Ints, unpainted: Bools) -> Layers:
    """Put the regions in order.

    Args:
        loops: of all regions.
        tree: of the regions.
        sizes: pixels of each region, shape (region,).
        unpainted: regions that lie below all others and are left out, shape (region,).
    """
    votes = _votes(loops, unpainted)
    cracks = np.bincount(
        np.maximum(loops.region, 0), np.where(loops.region >= 0, np.diff(loops.first), 0), len(sizes)
    )
    thin = 2 * sizes < THIN * cracks
    order: list[int] = []
    waiting = [NOBODY]
    while waiting:
        region = waiting.pop()
        if region != NOBODY and not unpainted[region]:
            order.append(region)
        for siblings in tree.children.get(region, []):
            waiting.extend(reversed(_sorted(siblings, votes, sizes, thin)))
    rank = np.full(len(sizes), -1, np.int64)
    rank[order] = np.arange(len(order))
    return Layers(rank, np.asarray(order, np.int64))


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
        lengths = hypot(*ahead.T) * hypot(*behind.T)
        cosines = (ahead * behind).sum(axis=1) / np.maximum(lengths, 1e-6)
        for change, cosine in zip(changes.tolist(), cosines.tolist(), strict=True):
            if cosine >= STRAIGHT:
                below = votes.setdefault(region, {})
                for other in (int(others[change]), int(others[change - 1])):
                    below[other] = below.get(other, 0.0) + 1.0
    return votes


def _sorted(siblings: list[int], votes: dict[int, dict[int, float]], sizes: Ints, thin: Bools) -> list[int]:
    """From the back on. Lines lie below: what they separate is drawn over them, and where it does not quite
    meet, the line shows.
    """
    by_size = sorted(siblings, key=lambda region: (not thin[region], -int(sizes[region])))
    if len(by_size) > SIBLINGS or len(by_size) < 2:
        return by_size
    index = {region: i for i, region in enumerate(by_size)}
    above: Floats = np.zeros((len(by_size), len(by_size)))
    for region in by_size:
        for other, weight in votes.get(region, {}).items():
            if other in index and not thin[region]:
                above[index[region], index[other]] += weight
    net = above - above.T
    left = list(range(len(by_size)))
    result = []
    while left:
        part = net[np.ix_(left, left)]
        # The next from the back has the least above-ness over all the others that are left.
        result.append(left.pop(int(np.argmin(np.maximum(part, 0).sum(axis=1)))))
    return [by_size[i] for i in result]
