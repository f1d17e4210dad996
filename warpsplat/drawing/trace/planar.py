"""The planar map of a label map: regions bounded by loops of cracks, the sides of pixels between two labels.

Cracks are directed: the region that a loop bounds lies on their right (the y axis points down).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpsplat.drawing.trace.grids import (
    NO_REGION,
    Bools,
    Floats,
    Ints,
    Sets,
    crossings,
    prefers_main_diagonal,
)

RIGHT, DOWN, LEFT, UP = range(4)

INSIDE = -np.array([(way in (DOWN, LEFT), way in (LEFT, UP)) for way in (RIGHT, DOWN, LEFT, UP)], np.intp)
"""x and y of the pixel on the right of a crack by its direction, from the vertex where it begins."""

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


def find_loops(labels: Ints, image: Floats, chosen: Bools | None = None) -> Loops:
    """Trace the boundaries of regions.

    Args:
        labels: Shape (height, width).
        image: What the labels are of; it decides which of two regions is connected where they cross.
        chosen: The regions, shape (region,). None: all, and the outside of the image.
    """
    height, width = labels.shape
    padded = np.pad(labels, 1, constant_values=NO_REGION)
    corners = [padded[1 + y :, 1 + x :][: height + 1, : width + 1] for x, y in INSIDE.tolist()]
    # Two diagonal pixels of one label are connected in a vertex, unless the other two are.
    rows, columns = np.nonzero(crossings(labels))
    prefers_main = prefers_main_diagonal(image, rows, columns)
    parted = np.zeros((2, height + 1, width + 1), np.bool_)  # on the main diagonal, and on the other one
    parted[prefers_main.astype(np.intp), rows + 1, columns + 1] = True
    wanted = None if chosen is None else np.append(chosen, False)  # NO_REGION is the last
    keys, following, regions, others = [], [], [], []
    for direction in (RIGHT, DOWN, LEFT, UP):
        inside, outside = corners[direction], corners[direction - 1]
        differ = inside != outside
        ys, xs = np.nonzero(differ if wanted is None else differ & wanted[inside])
        mine, theirs = inside[ys, xs], outside[ys, xs]
        end_x, end_y = xs + STEPS[direction, 0], ys + STEPS[direction, 1]
        goes_on, crosses = inside[end_y, end_x] == mine, outside[end_y, end_x] == mine
        # At the end of a level crack, ours and the pixel across are on the other diagonal.
        crosses &= goes_on | ~parted[int(direction in (RIGHT, LEFT)), end_y, end_x]
        turn = np.where(crosses, UP, np.where(goes_on, RIGHT, DOWN))
        keys.append((ys * (width + 1) + xs) * 4 + direction)
        following.append((end_y * (width + 1) + end_x) * 4 + (direction + turn) % 4)
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
    pairs = np.unique(loop[np.argsort(crack, kind="stable")].reshape(-1, 2), axis=0)
    sets = Sets(len(first) - 1)
    for a, b in pairs.tolist():
        sets.join(a, b)
    return sets.numbers()
