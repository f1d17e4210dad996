"""Pixels as mixtures of two regions beside them, which antialiasing produces."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass, fields

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Floats, Ints, channel_max

DIRECTIONS = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
"""Steps (row, column) along which neighbouring regions are looked for."""

REACH = 3  # [px] how far
CHUNK = 1 << 14  # pixels handled at once, which bounds the memory
DISTANCE_COST = 0.5  # [levels] what a pixel of distance to a region counts against it
RESIDUAL_WEIGHT = 0.01  # keeps an order among mixtures whose residual is within the slack
SLACK = 0.2  # how far a mixture may be off for free in a noisy image, over the difference of its colours:
# JPEG blurs hues more than lightness
MIXED = 7.0  # [levels] up to this residual, besides noise, a pixel is a mixture


@dataclass(frozen=True)
class Mixtures:
    """The best mixture for each of some pixels."""

    label: Ints
    """The region with the larger share; NO_REGION where none is near. Shape (pixel,)."""
    color: Floats
    """The colour of that region there, shape (pixel, channel)."""
    share: Floats
    """Its share, shape (pixel,)."""
    residual: Floats
    """Distance of the pixel's colour from the mixture [levels]; infinite where no region is near."""
    base: Floats
    """The colour of the nearest region of all, shape (pixel, channel)."""


def mixed(pixels: Floats, one: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Return the share of the first of two colours in pixels, and how far off the mixture is [levels].

    The share may be below 0 or beyond 1, though the mixture is not. All have the shape (..., channel).
    """
    # Channel by channel: sums along an axis of four take ten times as long.
    pixels, one, other = (np.moveaxis(each, -1, 0) for each in (pixels, one, other))
    between, beyond = ([a - c for a, c in zip(b, other, strict=True)] for b in (one, pixels))
    square = sum(a * a for a in between)
    share = np.asarray(sum(a * b for a, b in zip(beyond, between, strict=True)) / np.maximum(square, 1))
    inside = np.clip(share, 0, 1)
    off = functools.reduce(np.maximum, (np.abs(a - inside * b) for a, b in zip(beyond, between, strict=True)))
    return share, off


def unmix(
    image: Floats,
    labels: Ints,
    fills: Floats,
    rows: Ints,
    columns: Ints,
    noise: float = 0.0,
    reach: int = REACH,
) -> Mixtures:
    """Find for each pixel the two regions beside it whose mixture is nearest to its colour.

    Args:
        image: Shape (height, width, channel).
        labels: The region of each pixel, or NO_REGION where it is not known; shape (height, width).
        fills: The colour of that region there, shape (height, width, channel).
        rows: Of the pixels, shape (pixel,).
        columns: Of the pixels, shape (pixel,).
        noise: Where it is not 0, mixtures have some slack.
        reach: How far away regions are looked for [px].
    """
    parts = [
        _unmix(image, labels, fills, rows[i : i + CHUNK], columns[i : i + CHUNK], noise, reach)
        for i in range(0, max(len(rows), 1), CHUNK)
    ]
    return Mixtures(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Mixtures)))


def neighbours(labels: Ints, rows: Ints, columns: Ints, most: int) -> tuple[Ints, Ints, Floats]:
    """Return region, index and distance of the nearest labelled pixel by direction, (direction, pixel)."""
    height, width = labels.shape
    shape = (len(DIRECTIONS), len(rows))
    found = np.full(shape, NO_REGION, np.int32)
    index = np.zeros(shape, np.int64)
    distance = np.full(shape, np.inf, np.float32)
    for direction, (down, right) in enumerate(DIRECTIONS):
        length = math.sqrt(down * down + right * right)
        for reach in range(1, most + 1):
            y, x = rows + reach * down, columns + reach * right
            near = (y >= 0) & (y < height) & (x >= 0) & (x < width) & (found[direction] == NO_REGION)
            y, x = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
            near &= labels[y, x] != NO_REGION
            found[direction][near] = labels[y, x][near]
            index[direction][near] = (y * width + x)[near]
            distance[direction][near] = reach * length
    return found, index, distance


def _unmix(
    image: Floats, labels: Ints, fills: Floats, rows: Ints, columns: Ints, noise: float, reach: int
) -> Mixtures:
    found, index, distance = neighbours(labels, rows, columns, reach)
    colors = fills.reshape(-1, fills.shape[2])[index]
    # Each channel lies together: steps of four take several times as long.
    colors = np.moveaxis(np.ascontiguousarray(np.moveaxis(colors, 2, 0)), 0, 2)
    pixels = np.ascontiguousarray(image[rows, columns].T).T
    count, slack = len(rows), SLACK if noise else 0.0
    best = np.full(count, np.inf, np.float32)
    residual = np.full(count, np.inf, np.float32)
    winner, share = np.zeros(count, np.int64), np.ones(count, np.float32)
    for a, b in itertools.combinations_with_replacement(range(len(DIRECTIONS)), 2):
        known = (found[a] != NO_REGION) & (found[b] != NO_REGION)
        t, off = mixed(pixels, colors[a], colors[b])
        t = np.clip(t, 0, 1)
        contrast = channel_max(np.abs(colors[a] - colors[b])) if slack else 0
        off = np.maximum(off - slack * contrast, 0) + RESIDUAL_WEIGHT * off
        cost = np.where(known, off + DISTANCE_COST * (distance[a] + distance[b]), np.inf)
        better = cost < best
        best[better], residual[better] = cost[better], off[better]
        winner[better] = np.where(t >= 0.5, a, b)[better]
        share[better] = np.maximum(t, 1 - t)[better]
    each = np.arange(count)
    return Mixtures(
        label=found[winner, each],
        color=colors[winner, each],
        share=share,
        residual=residual,
        base=colors[np.argmin(distance, axis=0), each],
    )
