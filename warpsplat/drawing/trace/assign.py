"""A colouring for every pixel: mixed pixels, pixels far from all seeds, and regions too small to be seen.

The functions take and return ``painted``, the number of each pixel's colouring, shape (height, width), and
``fills``, the colour that it would have if its region covered it, shape (height, width, 4).
"""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Floats, Ints, components, nearest_in
from warpsplat.drawing.trace.mixtures import MIXED, REACH, unmix
from warpsplat.drawing.trace.palette import Coloring, Parts, least_worth

SMALL = 60  # [px] of the largest region that may be given up

REACHES = REACH, REACH, REACH, 2 * REACH
"""How far away the regions may lie that it is mixed of, in turn [px]: the tips of stars are long."""


def fill_gaps(image: Floats, parts: Parts) -> tuple[Ints, Floats]:
    """Give the unlabelled pixels to what has the largest share in them, or else to the nearest part.

    That may be the flat colour that covers most, however far its parts are: between dense lines no pixel is
    free of them, and paper that has no seed near it would be taken for ink.
    """
    painted = np.where(parts.labels == NO_REGION, NO_REGION, parts.paint[parts.labels])
    main = main_color(painted, parts.colorings)
    fills, (rows, columns) = parts.fills.copy(), np.nonzero(painted == NO_REGION)
    found = unmix(image, painted, fills, rows, columns, main=main)
    painted[rows, columns], fills[rows, columns] = found.label, found.color
    empty = painted == NO_REGION
    if empty.any():
        take = nearest_in(~empty)[empty]
        painted[empty], fills[empty] = painted.reshape(-1)[take], fills.reshape(-1, fills.shape[2])[take]
    return painted, fills


def main_color(painted: Ints, colorings: list[Coloring]) -> tuple[int, Floats] | None:
    """Return number and colour of the flat colouring that covers most of an image; None if none does."""
    sizes = np.bincount(painted[painted != NO_REGION], minlength=len(colorings))
    sizes = sizes * [coloring.ramp is None for coloring in colorings]
    most = int(sizes.argmax())
    return (most, colorings[most].color) if sizes[most] else None


def without_specks(
    image: Floats, painted: Ints, fills: Floats, noise: float, price: float = 1.0
) -> tuple[Ints, Floats]:
    """Give up small regions, and pixels of such ones, that are little more than mixtures of what is around.

    ``price``: as for ``find_regions``.
    """
    painted, fills = painted.copy(), fills.copy()
    for reach in REACHES:
        regions, _ = components(painted)
        sizes = np.bincount(regions.reshape(-1))
        small = (sizes <= SMALL)[regions]
        rows, columns = np.nonzero(small)
        if not len(rows) or small.all():
            continue
        others = np.where(small, NO_REGION, painted).astype(np.int32)
        mixtures = unmix(image, others, fills, rows, columns, noise, reach)
        owner, least = regions[rows, columns], least_worth(len(sizes), painted.size, noise, price=price)
        visible = np.maximum(mixtures.residual - (MIXED + noise), 0)
        error = np.bincount(owner, np.square(visible), len(sizes))
        gone = (error <= least)[owner] | (visible == 0)
        rows, columns = rows[gone], columns[gone]
        painted[rows, columns], fills[rows, columns] = mixtures.label[gone], mixtures.color[gone]
    return painted, fills
