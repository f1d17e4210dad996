"""Which region lies under which: a tree of what is inside what, and larger ones below smaller ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Ints
from warpsplat.drawing.trace.planar import Loops

LINE_WIDTH = 7.0  # [cell] of the widest region that is a line


@dataclass(frozen=True)
class Tree:
    """Which regions lie in the holes of which."""

    children: dict[int, list[list[int]]]
    """The networks of regions in the holes of each region; those of NO_REGION make up the image."""
    parent: Ints
    """The region in a hole of which each lies; NO_REGION for the outermost. Shape (region,)."""
    touches: Bools
    """Whether it has a boundary with its parent, shape (region,)."""

    def downwards(self) -> list[int]:
        """Return all regions, parents before children."""
        order, waiting = [], [NO_REGION]
        while waiting:
            for siblings in self.children.get(waiting.pop(), []):
                order.extend(siblings)
                waiting.extend(siblings)
        return order


def find_tree(loops: Loops, count: int) -> Tree:
    """Return the tree of ``count`` regions."""
    outer: dict[int, int] = {}
    touching: set[tuple[int, int]] = set()
    inside: dict[int, list[int]] = {}
    for loop in range(len(loops)):
        region, network = int(loops.region[loop]), int(loops.network[loop])
        # The outside of the image has its loop around the image, as a hole of it.
        if loops.is_hole[loop]:
            outer[network] = region
            others = loops.others[loops.first[loop] : loops.first[loop + 1]]
            touching |= {(other, region) for other in set(others.tolist())}
        else:
            inside.setdefault(network, []).append(region)
    children: dict[int, list[list[int]]] = {}
    parent = np.full(count, NO_REGION, np.int64)
    for network, regions in inside.items():
        around = outer.get(network, NO_REGION)
        children.setdefault(around, []).append(regions)
        parent[regions] = around
    touches = np.array([(region, int(parent[region])) in touching for region in range(count)], np.bool_)
    return Tree(children, parent, touches)


def bare_ground(tree: Tree, like_ground: Bools) -> Bools:
    """Find the regions of the ground's colour that need no paint: nothing painted lies under them."""
    bare = np.zeros(len(like_ground), np.bool_)
    for region in tree.downwards():
        around = int(tree.parent[region])
        if not like_ground[region]:
            continue
        if around == NO_REGION or bare[around]:
            bare[region] = True
        elif tree.touches[region]:
            beyond = int(tree.parent[around])
            bare[region] = beyond == NO_REGION or bare[beyond]
    return bare


def has_inside(tree: Tree, marked: Bools) -> Bools:
    """Find the regions that are marked or have a marked one inside them."""
    found = marked.copy()
    for region in reversed(tree.downwards()):
        if found[region] and tree.parent[region] != NO_REGION:
            found[tree.parent[region]] = True
    return found


def enclosed(loops: Loops, marked: Bools) -> Bools:
    """Find the marked regions that do not reach the border of the image."""
    found = marked.copy()
    outer = np.repeat(loops.region, np.diff(loops.first))[loops.others == NO_REGION]
    found[outer[outer != NO_REGION]] = False
    return found


def in_holes_with(loops: Loops, marked: Bools) -> Bools:
    """Find the regions that lie in a hole with a marked one, or beside all others with one."""
    outer = ~loops.is_hole
    network, region = loops.network[outer], loops.region[outer]
    found = marked.copy()
    found[region] = (np.bincount(network, marked[region]) > 0)[network]
    return found


def find_ranks(loops: Loops, tree: Tree, sizes: Ints, unpainted: Bools) -> Ints:
    """Put the regions in the order of painting: what lies in a region after it, the larger ones first.

    Lines lie at the back: what they separate is drawn over them, and where it does not quite meet, the line
    shows.

    Args:
        loops: Of all regions.
        tree: Of the regions.
        sizes: Pixels of each region, shape (region,).
        unpainted: Regions that lie below all others and are left out, shape (region,).

    Returns:
        The rank of each region: higher is painted later; -1 for those that are not painted. Shape (region,).
    """
    cracks = np.bincount(
        np.maximum(loops.region, 0), np.where(loops.region >= 0, np.diff(loops.first), 0), len(sizes)
    )
    is_line = 2 * sizes < LINE_WIDTH * cracks
    rank = np.full(len(sizes), -1, np.int64)
    count, waiting = 0, [NO_REGION]
    while waiting:
        region = waiting.pop()
        if region != NO_REGION and not unpainted[region]:
            rank[region] = count
            count += 1
        for siblings in tree.children.get(region, []):
            waiting.extend(sorted(siblings, key=lambda one: (is_line[one], sizes[one])))
    return rank
