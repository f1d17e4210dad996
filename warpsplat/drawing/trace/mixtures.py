"""Pixels as mixtures of two regions beside them, which antialiasing produces."""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass, fields

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints, channel_max

STEPS = np.array(list(np.ndindex(3, 3))) - 1
"""Steps (row, column) along which regions are looked for: to the pixel itself, and in eight directions."""

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
    other: Ints
    """The other region, or the same."""
    share: Floats
    """Share of the first, 1/2 to 1."""
    color: Floats
    """The colour of the first there, shape (pixel, channel)."""
    contrast: Floats
    """How far the two colours are apart [levels]."""
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
    apart: Bools | None = None,
    main: tuple[int, Floats] | None = None,
) -> Mixtures:
    """Find for each pixel the two regions, its own or beside it, whose mixture is nearest to its colour.

    Args:
        image: Shape (height, width, channel).
        labels: The region of each pixel, or NO_REGION where it is not known; shape (height, width).
        fills: The colour of that region there, shape (height, width, channel).
        rows: Of the pixels, shape (pixel,).
        columns: Of the pixels, shape (pixel,).
        noise: Where it is not 0, mixtures have some slack.
        reach: How far away regions are looked for [px].
        apart: The regions that are not mixed with one another, shape (region,).
        main: A region and its colour that may be mixed with those near where these alone do not explain a
            pixel, wherever it is.
    """

    def found(some: slice) -> Mixtures:
        return _unmix(image, labels, fills, rows[some], columns[some], noise, reach, apart, main)

    parts = [found(slice(i, i + CHUNK)) for i in range(0, max(len(rows), 1), CHUNK)]
    return Mixtures(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Mixtures)))


def neighbours(labels: Ints, rows: Ints, columns: Ints, most: int) -> tuple[Ints, Ints, Floats]:
    """Return label, index and distance of each pixel and of the nearest others by direction, (9, pixel)."""
    padded, own = np.pad(labels, most, constant_values=NO_REGION), labels[rows, columns]
    shape = len(STEPS), len(rows)
    found, index = np.full(shape, NO_REGION, np.int32), np.zeros(shape, np.int64)
    distance = np.full(shape, np.inf, np.float32)
    for i, (down, right) in enumerate(STEPS.tolist()):
        length = float(np.sqrt(down * down + right * right))
        for reach in range(most, 0, -1) if length else (0,):
            y, x = rows + reach * down, columns + reach * right
            label = padded[y + most, x + most]
            near = (label != NO_REGION) & ((label != own) | (reach == 0))
            found[i][near], distance[i][near] = label[near], reach * length
            index[i][near] = (y * labels.shape[1] + x)[near]
    return found, index, distance


def _unmix(
    image: Floats,
    labels: Ints,
    fills: Floats,
    rows: Ints,
    columns: Ints,
    noise: float,
    reach: int,
    apart: Bools | None,
    main: tuple[int, Floats] | None,
) -> Mixtures:
    found, index, distance = neighbours(labels, rows, columns, reach)
    colors = fills.reshape(-1, fills.shape[2])[index]
    base = colors[np.argmin(distance, axis=0), np.arange(len(rows))]
    pairs = list(itertools.combinations_with_replacement(range(len(STEPS)), 2))
    if main is not None:
        pairs += [(i, len(STEPS)) for i in range(len(STEPS))]
        found = np.concatenate([found, np.full_like(found[:1], main[0])])
        colors = np.concatenate([colors, np.broadcast_to(main[1], colors[:1].shape).astype(colors.dtype)])
        distance = np.concatenate([distance, np.full_like(distance[:1], (MIXED + noise) / DISTANCE_COST)])
    # Each channel lies together: steps of four take several times as long.
    colors = np.moveaxis(np.ascontiguousarray(np.moveaxis(colors, 2, 0)), 0, 2)
    pixels = np.ascontiguousarray(image[rows, columns].T).T
    count, slack = len(rows), SLACK if noise else 0.0
    best, residual = np.full((2, count), np.inf, np.float32)
    one, other, share = np.zeros(count, np.int64), np.zeros(count, np.int64), np.ones(count, np.float32)
    for a, b in pairs:
        known = (found[a] != NO_REGION) & (found[b] != NO_REGION)
        if apart is not None:
            known &= (found[a] == found[b]) | ~(apart[found[a]] & apart[found[b]])
        if not known.any():
            continue
        t, off = mixed(pixels, colors[a], colors[b])
        contrast = channel_max(np.abs(colors[a] - colors[b])) if slack else 0
        order, off = RESIDUAL_WEIGHT * off, np.maximum(off - slack * contrast, 0)
        if b == len(STEPS):
            known &= off <= MIXED + noise
        cost = np.where(known, off + order + DISTANCE_COST * (distance[a] + distance[b]), np.inf)
        better = cost < best
        best[better], residual[better], share[better] = cost[better], off[better], t[better]
        one[better], other[better] = a, b
    is_other, share, each = share < 0.5, np.clip(share, 0, 1), np.arange(count)
    one, other = np.where(is_other, other, one), np.where(is_other, one, other)
    color = colors[one, each]
    return Mixtures(
        label=found[one, each],
        other=found[other, each],
        share=np.maximum(share, 1 - share),
        color=color,
        contrast=channel_max(np.abs(color - colors[other, each])),
        residual=residual,
        base=base,
    )
