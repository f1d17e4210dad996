"""The planar map of a label map: regions bounded by loops of cracks, the sides of cells between two labels.

Cracks are directed: the region that a loop bounds lies on their right (the y axis points down).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, joined
from warpsplat.drawing.trace.label_map import LabelMap

RIGHT, DOWN, LEFT, UP = range(4)

INSIDE = -np.array([(way in (DOWN, LEFT), way in (LEFT, UP)) for way in (RIGHT, DOWN, LEFT, UP)], np.intp)
"""x and y of the cell on the right of a crack by its direction, from the vertex where it begins."""

OUTSIDE = INSIDE[[UP, RIGHT, DOWN, LEFT]]
"""The same on its left."""

STEPS = INSIDE - INSIDE[[DOWN, LEFT, UP, RIGHT]]
"""x and y of a crack by its direction."""


@dataclass(frozen=True)
class Loops:
    """All loops, one after the other."""

    first: Ints
    """First crack of each loop and, last, the number of cracks, shape (loop + 1,)."""
    region: Ints
    """The region that each loop bounds; NO_REGION for the outside of the image. Shape (loop,)."""
    is_hole: Bools
    """Whether the loop bounds a hole of its region, shape (loop,)."""
    vertices: Ints
    """Where each crack begins: x, y; shape (crack, 2)."""
    directions: Ints
    """Shape (crack,)."""
    others: Ints
    """The region on the left of each crack; NO_REGION outside the image. Shape (crack,)."""

    def __len__(self) -> int:
        return len(self.region)

    @cached_property
    def network(self) -> Ints:
        """Number of the connected set of cracks that each of all loops is in, shape (loop,)."""
        return _networks(self.vertices, self.directions, self.first)


def find_loops(labels: LabelMap, values: LabelMap, chosen: Bools | None = None) -> Loops:
    """Trace the boundaries of regions.

    Args:
        labels: Of the regions.
        values: What regions are components of; it decides which of two is connected where they cross.
        chosen: The regions, shape (region,). None: all, and the outside of the image.
    """
    width = labels.shape[1]
    (y, x, above, own), (row, column, before, mine) = labels.sides()
    cracks = {RIGHT: (x, y, own, above), LEFT: (x + 1, y, above, own)}
    cracks |= {DOWN: (column, row, before, mine), UP: (column, row + 1, mine, before)}
    wanted = None if chosen is None else np.append(chosen, False)  # NO_REGION is the last
    keys, following, regions, others = [], [], [], []
    for direction, found in cracks.items():
        some = slice(None) if wanted is None else wanted[found[2]]
        x, y, mine, theirs = (each[some] for each in found)
        end = np.stack([x, y], axis=1) + STEPS[direction]
        inside, outside = (labels.at(*(end + side[direction]).T[::-1]) for side in (INSIDE, OUTSIDE))
        goes_on, crosses = inside == mine, outside == mine
        # Two diagonal cells of one label are connected, unless the other two are.
        meets = np.flatnonzero(crosses & ~goes_on & (inside == theirs))
        main = values.prefers_main(end[meets, 1], end[meets, 0])
        # At the end of a level crack, ours and the cell across are on the other diagonal.
        crosses[meets[main == (direction in (RIGHT, LEFT))]] = False
        turn = np.where(crosses, UP, np.where(goes_on, RIGHT, DOWN))
        keys.append((y * (width + 1) + x) * 4 + direction)
        following.append((end[:, 1] * (width + 1) + end[:, 0]) * 4 + (direction + turn) % 4)
        regions.append(mine)
        others.append(theirs)
    return _assembled(width, *(np.concatenate(part) for part in (keys, following, regions, others)))


def _assembled(width: int, keys: Ints, following: Ints, regions: Ints, others: Ints) -> Loops:
    """Put the cracks in the order of their loops.

    Args:
        width: Of the image; a row has one vertex more.
        keys: A number for each crack: 4 x its vertex + its direction.
        following: The key of the crack after it.
        regions: On its right.
        others: On its left.
    """
    order = np.argsort(keys, kind="stable")
    after = np.searchsorted(keys[order], following[order]).tolist()
    seen = bytearray(len(after))
    walk: list[int] = []
    first = [0]
    for start in range(len(after)):
        if seen[start]:
            continue
        crack = start
        while not seen[crack]:
            seen[crack] = 1
            walk.append(crack)
            crack = after[crack]
        first.append(len(walk))
    index, starts = order[walk], np.asarray(first, np.intp)
    vertex, direction = keys[index] // 4, keys[index] % 4
    vertices = np.stack([vertex % (width + 1), vertex // (width + 1)], axis=1)
    return Loops(
        first=starts,
        region=regions[index][starts[:-1]],
        is_hole=_signed_areas(vertices, starts) < 0,
        vertices=vertices,
        directions=direction,
        others=others[index],
    )


def _signed_areas(vertices: Ints, first: Ints) -> Floats:
    """Return the area of each loop, positive where what is on its right is inside."""
    following = np.roll(vertices, -1, axis=0)
    following[first[1:] - 1] = vertices[first[:-1]]
    doubled = vertices[:, 0] * following[:, 1] - following[:, 0] * vertices[:, 1]
    return np.asarray(np.add.reduceat(doubled, first[:-1]) / 2)


def _networks(vertices: Ints, directions: Ints, first: Ints) -> Ints:
    """Number the sets of loops that are connected by the cracks that they share."""
    loop = np.repeat(np.arange(len(first) - 1), np.diff(first))
    # Both directions of a crack have the same upper left end.
    start = np.minimum(vertices, vertices + STEPS[directions])
    crack = (start[:, 1] * (vertices[:, 0].max(initial=0) + 1) + start[:, 0]) * 2 + directions % 2
    pairs = loop[np.argsort(crack, kind="stable")].reshape(-1, 2)
    return joined(len(first) - 1, *pairs.T)
