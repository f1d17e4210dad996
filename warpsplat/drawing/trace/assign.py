"""A colouring for every pixel: mixed pixels, pixels far from all seeds, and regions too small to be seen.

The functions take and return ``painted``, the number of each pixel's colouring, shape (height, width), and
``fills``, the colour that it would have if its region covered it, shape (height, width, 4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints, channel_max, components, nearest_in
from warpsplat.drawing.trace.mixtures import MIXED, REACH, unmix
from warpsplat.drawing.trace.palette import Parts

ORPHAN_ROUNDS = 4  # each of which takes one more row of pixels off an orphan's border

SMALL, TINY = (60, REACH), (12, 2 * REACH)
"""Pixels of the largest region that may be given up, and how far away the regions may lie that it is mixed of
[px]: the tips of stars are long."""

INVISIBLE = 120.0  # [levels] sum of the residuals of a region that is given up, at the most
INVISIBLE_PIXEL, MOST_COUNTED = 40.0, 8  # [levels] the same for each pixel, of which no more than these count
MOSTLY = 0.4  # share of mixtures in a noisy region, from which on these are no part of it: JPEG tints the
# tips of stars, and not all of a long one is near what it is a tip of


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


def without_orphans(image: Floats, painted: Ints, fills: Floats, *, sure: Bools) -> tuple[Ints, Floats]:
    """Give the pixels of regions that have no ``sure`` pixel to the neighbour nearest in colour."""
    painted, fills = painted.copy(), fills.copy()
    regions = components(painted, image)
    has_sure = np.zeros(int(regions.max()) + 1, np.bool_)
    has_sure[regions[sure]] = True
    orphan = ~has_sure[regions]
    height, width = painted.shape
    for _ in range(ORPHAN_ROUNDS):
        rows, columns = np.nonzero(orphan)
        best = np.full(len(rows), np.inf)
        source = rows * width + columns
        for down, right in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            y, x = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
            off = channel_max(np.abs(image[rows, columns] - fills[y, x]))
            better = ~orphan[y, x] & (off < best)
            best[better], source[better] = off[better], (y * width + x)[better]
        painted[rows, columns] = painted.reshape(-1)[source]
        fills[rows, columns] = fills.reshape(-1, fills.shape[2])[source]
        found = np.isfinite(best)
        orphan[rows[found], columns[found]] = False
    return painted, fills


def without_specks(
    image: Floats, painted: Ints, fills: Floats, noise: float, price: float = 1.0
) -> tuple[Ints, Floats, Bools]:
    """Give up small regions that are little more than mixtures of what is around them.

    ``price``: as for ``find_regions``.

    Returns:
        ``painted``, ``fills``, and the pixels of these regions, without those that have the colour that they
        now belong to; shape (height, width).
    """
    painted, fills = painted.copy(), fills.copy()
    given_up = np.zeros(painted.shape, np.bool_)
    for most, reach in (SMALL, TINY) if noise == 0 else (SMALL, SMALL, TINY):
        regions = components(painted, image)
        sizes = np.bincount(regions.reshape(-1))
        small = (sizes <= most)[regions]
        rows, columns = np.nonzero(small)
        if not len(rows) or small.all():
            continue
        others = np.where(small, NO_REGION, painted).astype(np.int32)
        mixtures = unmix(image, others, fills, rows, columns, noise, reach)
        visible = np.maximum(mixtures.residual - (MIXED + noise), 0)
        owner = regions[rows, columns]
        limit = np.maximum(INVISIBLE, INVISIBLE_PIXEL * np.minimum(sizes, MOST_COUNTED)) * min(price, 1)
        gone = (np.bincount(owner, visible, len(sizes)) <= limit)[owner]
        if noise:
            mixed = np.bincount(owner, visible == 0, len(sizes))
            gone |= (mixed >= MOSTLY * sizes)[owner] & (visible == 0)
        rows, columns, label = rows[gone], columns[gone], mixtures.label[gone]
        # A pixel of a pure colour is intended, even if the region of that colour lies beyond a line.
        off = channel_max(np.abs(image[rows, columns] - fills[rows, columns]))
        own = (label == painted[rows, columns]) & (off <= MIXED + noise)
        painted[rows, columns], fills[rows, columns] = label, mixtures.color[gone]
        given_up[rows[~own], columns[~own]] = True
    return painted, fills, given_up
