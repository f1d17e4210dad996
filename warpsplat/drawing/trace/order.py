"""Which region lies under which: a tree of what is inside what, and votes among neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints
from warpsplat.drawing.trace.planar import STEPS, Loops
from warpsplat.portable.elementary import hypot

LINE_WIDTH = 7.0  # [px] of the widest region that is a line
LOOK = 6  # cracks over which the direction of an outline is taken at a T-junction
STRAIGHT = 0.85  # cosine from which on an outline goes straight on there
MOST_SORTED = 400  # siblings that are put in order by votes; more are by size


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
    """Put the regions in the order of painting.

    Args:
        loops: Of all regions.
        tree: Of the regions.
        sizes: Pixels of each region, shape (region,).
        unpainted: Regions that lie below all others and are left out, shape (region,).

    Returns:
        The rank of each region: higher is painted later; -1 for those that are not painted. Shape (region,).
    """
    votes = _votes(loops, unpainted)
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
            waiting.extend(reversed(_sorted(siblings, votes, sizes, is_line)))
    return rank


def _votes(loops: Loops, unpainted: Bools) -> dict[int, dict[int, int]]:
    """Count at how many T-junctions a region a seems to lie above a region b: ``votes[a][b]``.

    Of the three regions that meet, the one whose outline goes straight on lies above the other two.
    """
    votes: dict[int, dict[int, int]] = {}
    for loop in range(len(loops)):
        region = int(loops.region[loop])
        if region == NO_REGION or unpainted[region]:
            continue
        low, high = int(loops.first[loop]), int(loops.first[loop + 1])
        others, size = loops.others[low:high], high - low
        changes = np.flatnonzero(others != np.roll(others, 1))
        if not len(changes):
            continue
        steps = STEPS[loops.directions[low:high]]
        window = np.arange(max(1, min(LOOK, size // 4)))[:, None]
        ahead = steps[(changes + window) % size].sum(axis=0)
        behind = steps[(changes - 1 - window) % size].sum(axis=0)
        lengths = hypot(*ahead.T) * hypot(*behind.T)
        cosines = (ahead * behind).sum(axis=1) / np.maximum(lengths, 1e-6)
        below = votes.setdefault(region, {})
        for change in changes[cosines >= STRAIGHT].tolist():
            for other in (int(others[change]), int(others[change - 1])):
                below[other] = below.get(other, 0) + 1
    return votes


def _sorted(siblings: list[int], votes: dict[int, dict[int, int]], sizes: Ints, is_line: Bools) -> list[int]:
    """Return siblings from the back to the front.

    Lines lie at the back: what they separate is drawn over them, and where it does not quite meet, the line
    shows.
    """
    by_size = sorted(siblings, key=lambda region: (not is_line[region], -int(sizes[region])))
    if len(by_size) > MOST_SORTED or len(by_size) < 2:
        return by_size
    index = {region: i for i, region in enumerate(by_size)}
    above: Floats = np.zeros((len(by_size), len(by_size)))
    for region in by_size:
        for other, count in votes.get(region, {}).items():
            if other in index and not is_line[region]:
                above[index[region], index[other]] += count
    above_minus_below = np.maximum(above - above.T, 0)
    left, result = list(range(len(by_size))), []
    while left:
        # Next comes the region with the fewest remaining regions below it.
        sums = above_minus_below[np.ix_(left, left)].sum(axis=1)
        result.append(by_size[left.pop(int(np.argmin(sums)))])
    return result
