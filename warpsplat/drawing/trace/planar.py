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

INSIDE = np.array([(0, 0), (-1, 0), (-1, -1), (0, -1)])
"""x and y of the pixel on the right of a crack by its direction, from the vertex where it begins."""

OUTSIDE = np.roll(INSIDE, 1, axis=0)
"""The same on its left."""

STEPS = INSIDE - np.roll(INSIDE, -1, axis=0)
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
    padded = np.pad(labels, 1, constant_values=NO_REGION)
    height, width = labels.shape
    main, other = _passages(labels, image)
    wanted = None if chosen is None else np.append(chosen, False)[padded]  # NO_REGION is the last
    keys, following, regions, others = [], [], [], []
    for direction in range(4):
        (in_x, in_y), (out_x, out_y) = INSIDE[direction], OUTSIDE[direction]
        step_x, step_y = STEPS[direction]
        is_level = direction in (RIGHT, LEFT)
        # Cracks begin at all vertices but those of one border.
        first = int(direction in (LEFT, UP))
        top, left = (0, first) if is_level else (first, 0)
        rows, columns = (height + 1, width) if is_level else (height, width + 1)
        within = padded[top : top + rows + 1, left : left + columns + 1]
        mine = within[in_y + 1 :, in_x + 1 :][:rows, :columns]
        theirs = within[out_y + 1 :, out_x + 1 :][:rows, :columns]
        differ = mine != theirs
        if wanted is not None:
            differ &= wanted[top + in_y + 1 :, left + in_x + 1 :][:rows, :columns]
        ys, xs = np.nonzero(differ)
        mine, theirs = mine[ys, xs], theirs[ys, xs]
        ys, xs = ys + top, xs + left
        end_y, end_x = ys + step_y, xs + step_x
        ahead = padded[end_y + in_y + 1, end_x + in_x + 1]
        ahead_left = padded[end_y + out_y + 1, end_x + out_x + 1]
        # At the end of a level crack, ours and the pixel across are on the other diagonal.
        passes = (other if is_level else main)[end_y, end_x]
        turn = np.where(ahead != mine, 1, np.where(ahead_left != mine, 0, 3))
        turn = np.where((ahead != mine) & (ahead_left == mine) & passes, 3, turn)
        keys.append((ys * (width + 1) + xs) * 4 + direction)
        following.append((end_y * (width + 1) + end_x) * 4 + (direction + turn) % 4)
        regions.append(mine)
        others.append(theirs)
    return _assembled(width, *(np.concatenate(part) for part in (keys, following, regions, others)))


def _passages(labels: Ints, image: Floats) -> tuple[Bools, Bools]:
    """Find the vertices where two diagonal pixels are connected though they share a point only.

    Returns:
        For the main diagonal, and for the other one, shape (height + 1, width + 1).
    """
    height, width = labels.shape
    main = np.zeros((height + 1, width + 1), np.bool_)
    other = np.zeros_like(main)
    a, b, c, d = labels[:-1, :-1], labels[:-1, 1:], labels[1:, :-1], labels[1:, 1:]
    main[1:-1, 1:-1] = (a == d) & (b != a) & (c != a)
    other[1:-1, 1:-1] = (b == c) & (a != b) & (d != b)
    rows, columns = np.nonzero(crossings(labels))
    preferred = prefers_main_diagonal(image, rows, columns)
    main[rows + 1, columns + 1] = preferred
    other[rows + 1, columns + 1] = ~preferred
    return main, other


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
