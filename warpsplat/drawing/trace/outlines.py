"""Sub-pixel outlines: where in the antialiased pixels beside a crack the boundary lies.

In a column of pixels that a boundary crosses from left to right, the sum of what is covered is the boundary's
mean height in the column: for a straight one, its height in the middle of the column, exactly.
"""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import NOBODY, Bools, Floats, Ints
from warpsplat.drawing.trace.planar import INSIDE, LEFT, OUTSIDE, RIGHT, STEPS, Loops

REACH = 3
"""Pixels on each side that are looked at."""

PURE = 0.02
"""Share of the other region in a pixel from which on it is mixed."""

STRANGE = 20.0
"""How far a pixel may be from a mixture of the two [levels]; beyond, a third region has part in it."""

TREND = 3
"""Cracks ahead and behind that tell the direction of an outline."""


def crack_offsets(loops: Loops, image: Floats, labels: Ints, pure: Floats) -> Floats:
    """How far the boundary lies to the left of each crack [px], shape (crack,)."""
    inner = loops.vertices + INSIDE[loops.ways]
    outer = loops.vertices + OUTSIDE[loops.ways]
    step = outer - inner
    real = loops.others != NOBODY
    height, width = labels.shape
    real &= ((inner >= 0) & (inner < [width, height])).all(axis=1)
    offsets = np.zeros(len(inner))
    inner, outer, step = inner[real], outer[real], step[real]
    mine, theirs = pure[inner[:, 1], inner[:, 0]], pure[outer[:, 1], outer[:, 0]]
    found = _intrusion(image, labels, outer, step, mine, theirs)
    found -= _intrusion(image, labels, inner, -step, theirs, mine)
    offsets[real] = found
    return offsets


def _intrusion(image: Floats, labels: Ints, start: Ints, step: Ints, mine: Floats, theirs: Floats) -> Floats:
    """How much of ``mine`` is in the pixels of the other region, from ``start`` on [px]."""
    height, width = labels.shape
    between = mine - theirs
    square = np.maximum((between.astype(np.float64) ** 2).sum(axis=1), 1e-6)
    total = np.zeros(len(start))
    label = labels[start[:, 1], start[:, 0]]
    active = np.ones(len(start), np.bool_)
    before = np.full(len(start), 1.0)
    for reach in range(REACH):
        at = start + reach * step
        active &= ((at >= 0) & (at < [width, height])).all(axis=1)
        x, y = np.clip(at[:, 0], 0, width - 1), np.clip(at[:, 1], 0, height - 1)
        active &= labels[y, x] == label
        away = image[y, x] - theirs
        share = np.clip((away * between).sum(axis=1) / square, 0, 1)
        off = np.abs(away - share[:, None] * between).max(axis=1)
        active &= (share <= before + PURE) & (share > PURE) & (off < STRANGE)
        total += np.where(active, share, 0)
        before = share
    return total


def trends(loops: Loops) -> Floats:
    """Direction of the outline at each crack, from those near it; shape (crack, 2)."""
    steps = STEPS[loops.ways].astype(np.float64)
    sizes = np.diff(loops.first)
    position = np.arange(len(steps)) - np.repeat(loops.first[:-1], sizes)
    size, base = np.repeat(sizes, sizes), np.repeat(loops.first[:-1], sizes)
    total = steps.copy()
    for away in range(1, TREND + 1):
        # The outermost count half: on a diagonal, horizontal and vertical ones are then as many.
        share = 0.5 if away == TREND else 1.0
        total += share * (steps[base + (position + away) % size] + steps[base + (position - away) % size])
    return np.asarray(total)


def places(loops: Loops, offsets: Floats) -> tuple[Floats, Bools]:
    """Points of the outlines: one for each crack, and which of them to use: of a flat part of an outline
    those on its horizontal cracks, of a steep one those on the others. Shapes (crack, 2), (crack,).
    """
    steps = STEPS[loops.ways]
    normal = np.stack([steps[:, 1], -steps[:, 0]], axis=1)  # to the left, as y points down
    points = loops.vertices + 0.5 * steps + offsets[:, None] * normal
    trend = np.abs(trends(loops))
    horizontal = (loops.ways == RIGHT) | (loops.ways == LEFT)
    good = np.where(horizontal, trend[:, 0] >= trend[:, 1], trend[:, 1] > trend[:, 0])
    return points, good
