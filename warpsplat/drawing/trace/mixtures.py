"""Pixels that are mixtures of the regions beside them, as antialiasing makes them."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.grids import NOBODY, Floats, Ints

WAYS = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
"""Where the neighbours are looked for: rows and columns of a step."""

REACH = 3
"""How far [px]."""

CHUNK = 1 << 16
"""Pixels that are looked at together."""

FAR = 0.5
"""What a pixel of distance counts against an explanation [levels]."""


@dataclass(frozen=True)
class Explained:
    """What each of some pixels is made of."""

    label: Ints
    """The region that has most of it; NOBODY where none is near. Shape (pixel,)."""
    color: Floats
    """The colour of that region there, shape (pixel, channel)."""
    residual: Floats
    """How far the pixel is from any mixture of two neighbours [levels]; infinite where there are none."""
    share: Floats
    """Of that region in the pixel, shape (pixel,)."""
    base: Floats
    """Colour of the nearest neighbour of all, shape (pixel, channel)."""
    kinds: Ints
    """How many different regions are near, shape (pixel,)."""


def explain(
    image: Floats,
    labels: Ints,
    pure: Floats,
    rows: Ints,
    columns: Ints,
    slack: float = 0.0,
    reach: int = REACH,
) -> Explained:
    """Find for each pixel the two neighbouring regions that it is nearest to a mixture of.

    Args:
        image: shape (height, width, channel).
        labels: the region of each pixel that is sure, else NOBODY; shape (height, width).
        pure: colours of the sure pixels' regions there, shape (height, width, channel).
        rows: of the pixels, shape (pixel,).
        columns: shape (pixel,).
        slack: how far a mixture may be off for the difference of its two colours: JPEG blurs hues more than
            lightness.
        reach: how far neighbours are looked for [px].
    """
    parts = [
        _explain(image, labels, pure, rows[i : i + CHUNK], columns[i : i + CHUNK], slack, reach)
        for i in range(0, max(len(rows), 1), CHUNK)
    ]
    return Explained(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in Explained.__dataclass_fields__)
    )


def _neighbours(labels: Ints, rows: Ints, columns: Ints, most: int) -> tuple[Ints, Ints, Floats]:
    """The nearest sure pixel each way: its region, its index, its distance; shape (way, pixel)."""
    height, width = labels.shape
    found = np.full((len(WAYS), len(rows)), NOBODY, np.int32)
    index = np.zeros((len(WAYS), len(rows)), np.int64)
    distance = np.full((len(WAYS), len(rows)), np.inf, np.float32)
    for way, (down, right) in enumerate(WAYS):
        length = math.sqrt(down * down + right * right)
        for reach in range(1, most + 1):
            y, x = rows + reach * down, columns + reach * right
            near = (y >= 0) & (y < height) & (x >= 0) & (x < width) & (found[way] == NOBODY)
            y, x = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
            near &= labels[y, x] != NOBODY
            found[way][near] = labels[y, x][near]
            index[way][near] = (y * width + x)[near]
            distance[way][near] = reach * length
    return found, index, distance


def _explain(
    image: Floats, labels: Ints, pure: Floats, rows: Ints, columns: Ints, slack: float, reach: int
) -> Explained:
    found, index, distance = _neighbours(labels, rows, columns, reach)
    # Channel by channel: sums along an axis of four take ten times as long.
    colors = np.ascontiguousarray(np.moveaxis(pure.reshape(-1, pure.shape[2])[index], 2, 1))
    pixel = np.ascontiguousarray(image[rows, columns].T)
    count, each = np.arange(len(rows)), len(WAYS)
    best = np.full(len(rows), np.inf, np.float32)
    residual = np.full(len(rows), np.inf, np.float32)
    winner, share = np.zeros(len(rows), np.int64), np.ones(len(rows), np.float32)
    for a, b in itertools.combinations_with_replacement(range(each), 2):
        known = (found[a] != NOBODY) & (found[b] != NOBODY)
        between = colors[a] - colors[b]
        square = np.maximum((between**2).sum(axis=0), 1e-6)
        t = np.clip(((pixel - colors[b]) * between).sum(axis=0) / square, 0, 1)
        off = np.abs(pixel - colors[b] - t * between).max(axis=0)
        off = np.maximum(off - slack * np.abs(between).max(axis=0), 0) + 0.01 * off
        cost = np.where(known, off + FAR * (distance[a] + distance[b]), np.inf)
        better = cost < best
        best[better], residual[better] = cost[better], off[better]
        winner[better] = np.where(t >= 0.5, a, b)[better]
        share[better] = np.maximum(t, 1 - t)[better]
    kinds = np.sort(found, axis=0)
    different = (np.diff(kinds, axis=0) != 0).sum(axis=0) + (kinds[0] != NOBODY)
    return Explained(
        label=found[winner, count],
        color=colors[winner, :, count],
        residual=residual,
        share=share,
        base=colors[np.argmin(distance, axis=0), :, count],
        kinds=different.astype(np.int32),
    )
