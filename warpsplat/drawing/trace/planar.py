"""The planar map of a label map: regions bounded by loops of cracks, the sides of pixels between two labels.

Cracks are directed: the region that a loop bounds lies on the right (the y axis points down).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NOBODY, Bools, Floats, Ints, Sets
from warpsplat.drawing.trace.regions import crossings, main_diagonal

RIGHT, DOWN, LEFT, UP = range(4)

STEPS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
"""x and y of a crack by its direction."""

INSIDE = np.array([(0, 0), (-1, 0), (-1, -1), (0, -1)])
"""x and y of the pixel on the right of a crack, from the vertex where it begins."""

OUTSIDE = np.array([(0, -1), (0, 0), (-1, 0), (-1, -1)])
"""The same on its left."""


@dataclass(frozen=True)
class Loops:
    """All loops, one after the other."""

    first: Ints
    """First crack of each loop and, last, the number of cracks, shape (loop + 1,)."""
    region: Ints
    """What each loop bounds; NOBODY for what is outside of the picture. Shape (loop,)."""
    is_hole: Bools
    """Whether the loop bounds it from inside, shape (loop,)."""
    network: Ints
    """Number of the connected set of cracks that each loop is in, shape (loop,)."""
    vertices: Ints
    """Where each crack begins: x, y; shape (crack, 2)."""
    ways: Ints
    """Direction of each crack, shape (crack,)."""
    others: Ints
    """The region on the left of each crack; NOBODY outside of the picture. Shape (crack,)."""

    def __len__(self) -> int:
        return len(self.region)


def find_loops(labels: Ints, image: Floats) -> Loops:
    """Trace the boundaries of all regions.

    Args:
        labels: shape (height, width).
        image: what the labels are of; says which of two regions is connected where they cross.
    """
    padded = np.pad(labels, 1, constant_values=NOBODY)
    height, width = labels.shape
    main, other = _passes(labels, image)
    keys, following, regions, others = [], [], [], []
    for way in range(4):
        (in_x, in_y), (out_x, out_y), (step_x, step_y) = INSIDE[way], OUTSIDE[way], STEPS[way]
        ys, xs = np.mgrid[0 : height + 1, 0 : width + 1]
        if way in (RIGHT, LEFT):
            ys, xs = (ys[:, 1:], xs[:, 1:]) if way == LEFT else (ys[:, :-1], xs[:, :-1])
        else:
            ys, xs = (ys[1:], xs[1:]) if way == UP else (ys[:-1], xs[:-1])
        mine, theirs = padded[ys + in_y + 1, xs + in_x + 1], padded[ys + out_y + 1, xs + out_x + 1]
        real = mine != theirs
        ys, xs, mine, theirs = ys[real], xs[real], mine[real], theirs[real]
        end_y, end_x = ys + step_y, xs + step_x
        ahead = padded[end_y + in_y + 1, end_x + in_x + 1]
        ahead_left = padded[end_y + out_y + 1, end_x + out_x + 1]
        # At the end of RIGHT and LEFT, ours and the one across are upper right to lower left.
        passes = (other if way in (RIGHT, LEFT) else main)[end_y, end_x]
        turn = np.where(ahead != mine, 1, np.where(ahead_left != mine, 0, 3))
        turn = np.where((ahead != mine) & (ahead_left == mine) & passes, 3, turn)
        keys.append((ys * (width + 1) + xs) * 4 + way)
        following.append((end_y * (width + 1) + end_x) * 4 + (way + turn) % 4)
        regions.append(mine)
        others.append(theirs)
    return _assembled(
        np.concatenate(keys),
        np.concatenate(following),
        np.concatenate(regions),
        np.concatenate(others),
        width,
    )


def _passes(labels: Ints, image: Floats) -> tuple[Bools, Bools]:
    """Vertices where the main diagonal's, or the other's, two pixels are connected though only a point
    joins them; shape (height + 1, width + 1).
    """
    height, width = labels.shape
    main = np.zeros((height + 1, width + 1), np.bool_)
    other = np.zeros_like(main)
    a, b, c, d = labels[:-1, :-1], labels[:-1, 1:], labels[1:, :-1], labels[1:, 1:]
    main[1:-1, 1:-1] = (a == d) & (b != a) & (c != a)
    other[1:-1, 1:-1] = (b == c) & (a != b) & (d != b)
    rows, columns = np.nonzero(crossings(labels))
    wins = main_diagonal(image, rows, columns)
    main[rows + 1, columns + 1] = wins
    other[rows + 1, columns + 1] = ~wins
    return main, other


def _assembled(keys: Ints, following: Ints, regions: Ints, others: Ints, width: int) -> Loops:
    order = np.argsort(keys, kind="stable")
    keys, following = keys[order], following[order]
    regions, others = regions[order], others[order]
    after = np.searchsorted(keys, following).tolist()
    seen = bytearray(len(after))
    walk: list[int] = []
    first = [0]
    for start in range(len(after)):
        crack = start
        while not seen[crack]:
            seen[crack] = 1
            walk.append(crack)
            crack = after[crack]
        if len(walk) > first[-1]:
            first.append(len(walk))
    index = np.asarray(walk, np.intp)
    vertex, way = keys[index] // 4, keys[index] % 4
    vertices = np.stack([vertex % (width + 1), vertex // (width + 1)], axis=1)
    starts = np.asarray(first, np.intp)
    return Loops(
        first=starts,
        region=regions[index][starts[:-1]],
        is_hole=_areas(vertices, starts) < 0,
        network=_networks(vertices, way, starts, width),
        vertices=vertices,
        ways=way,
        others=others[index],
    )


def _areas(vertices: Ints, first: Ints) -> Floats:
    """Signed area of each loop: positive where what is on the right is inside."""
    following = np.roll(vertices, -1, axis=0)
    following[first[1:] - 1] = vertices[first[:-1]]
    doubled = vertices[:, 0] * following[:, 1] - following[:, 0] * vertices[:, 1]
    return np.asarray(np.add.reduceat(doubled, first[:-1]) / 2)


def _networks(vertices: Ints, ways: Ints, first: Ints, width: int) -> Ints:
    """Loops that share a crack are of one network."""
    loop = np.repeat(np.arange(len(first) - 1), np.diff(first))
    # Both directions of a crack have the same upper left end.
    start = np.minimum(vertices, vertices + STEPS[ways])
    crack = (start[:, 1] * (width + 1) + start[:, 0]) * 2 + ways % 2
    order = np.argsort(crack, kind="stable")
    pairs = np.unique(loop[order].reshape(-1, 2), axis=0)
    sets = Sets(len(first) - 1)
    for a, b in pairs.tolist():
        sets.join(a, b)
    return sets.numbers()
