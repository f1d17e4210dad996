"""A colouring for every pixel: mixed pixels, pixels far from all seeds, and regions too small to be seen.

The functions take and return ``painted``, the number of each pixel's colouring, shape (height, width), and
``fills``, the colour that it would have if its region covered it, shape (height, width, 4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Floats, Ints, channel_max, components, nearest_in
from warpsplat.drawing.trace.mixtures import MIXED, REACH, unmix
from warpsplat.drawing.trace.palette import Parts, least_worth

SMALL = 60  # [px] of the largest region that may be given up

REACHES = REACH, REACH, REACH, 2 * REACH
"""How far away the regions may lie that it is mixed of, in turn [px]: the tips of stars are long."""


def with_main_color(image: Floats, parts: Parts, noise: float) -> Parts:
    """Give the main flat colour to the unlabelled pixels that are mostly of it, however far its parts are.

    Between dense lines no pixel is free of them: paper that has no seed near it would be taken for ink. Only
    pixels that no mixture of what is near explains are looked at.
    """
    known = parts.labels != NO_REGION
    is_flat = np.array([coloring.ramp is None for coloring in parts.colorings], np.bool_)[parts.paint]
    sizes = np.bincount(parts.labels[known], minlength=len(parts.paint)) * is_flat
    if not sizes.any():
        return parts
    # Of the colouring that covers most, which may be in many parts, the largest.
    main = int((sizes * (parts.paint == np.bincount(parts.paint, sizes).argmax())).argmax())
    color = parts.colorings[parts.paint[main]].color
    rows, columns = np.nonzero(~known)
    mixtures = unmix(image, parts.labels, parts.fills, rows, columns, noise)
    away, toward = image[rows, columns] - color, mixtures.base - color
    share = (away * toward).sum(axis=1) / np.maximum((toward**2).sum(axis=1), 1e-6)  # of what is near
    off = channel_max(np.abs(away - share[:, None] * toward))
    own = (mixtures.residual > MIXED + noise) & (share < 0.5) & (off <= MIXED + noise)
    labels, fills = parts.labels.copy(), parts.fills.copy()
    labels[rows[own], columns[own]] = main
    fills[rows[own], columns[own]] = color
    return replace(parts, labels=labels, fills=fills)


def fill_gaps(image: Floats, parts: Parts) -> tuple[Ints, Floats]:
    """Give the unlabelled pixels to the part with the largest share in them, or else to the nearest one."""
    labels, fills = parts.labels.copy(), parts.fills.copy()
    rows, columns = np.nonzero(labels == NO_REGION)
    mixtures = unmix(image, labels, fills, rows, columns)
    known = mixtures.label != NO_REGION
    labels[rows[known], columns[known]] = mixtures.label[known]
    fills[rows[known], columns[known]] = mixtures.color[known]
    empty = labels == NO_REGION
    if empty.any():
        take = nearest_in(~empty)[empty]
        labels[empty] = labels.reshape(-1)[take]
        fills[empty] = fills.reshape(-1, fills.shape[2])[take]
    return parts.paint[labels], fills


def without_specks(
    image: Floats, painted: Ints, fills: Floats, noise: float, price: float = 1.0
) -> tuple[Ints, Floats]:
    """Give up small regions, and pixels of such ones, that are little more than mixtures of what is around.

    ``price``: as for ``find_regions``.
    """
    painted, fills = painted.copy(), fills.copy()
    for reach in REACHES:
        regions = components(painted, image)
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
