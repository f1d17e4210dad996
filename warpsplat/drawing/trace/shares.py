"""Shares of colourings in the pixels of an image: each is of one colouring, or a mixture of two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, channel_max, nearest_in
from warpsplat.drawing.trace.mixtures import DISTANCE_COST, mixed
from warpsplat.drawing.trace.regions import Regions
from warpsplat.drawing.trace.seeds import OUTLIERS, ROUNDING
from warpsplat.portable import filters
from warpsplat.scene.scene import numbers_in

NEAR = 3.5
"""How far away the colourings lie that a pixel may be mixed of [px]."""

PURE = 0.02
"""Share of another colouring up to which a pixel is not mixed."""


@dataclass(frozen=True)
class Colors:
    """Colours of colourings in the pixels of an image."""

    mean: Floats
    """Mean colour of each colouring, shape (colouring, 4)."""
    ramps: dict[int, Floats]
    """Gradients, shape (height, width, 4): outside their own pixels the colour of the nearest one."""

    @staticmethod
    def of(regions: Regions, painted: Ints) -> Colors:
        """Return the colours of an image's regions; ``painted``: the colouring of each pixel."""
        fills = regions.fills.reshape(-1, regions.fills.shape[2])
        ramps = [k for k in numbers_in(painted).tolist() if regions.colorings[k].ramp is not None]
        mean = np.array([coloring.color for coloring in regions.colorings], np.float32)
        return Colors(mean, {k: fills[nearest_in(painted == k)] for k in ramps})

    def at(self, which: Ints, rows: Ints, columns: Ints) -> Floats:
        """Return the colours of the colourings ``which`` in some pixels, all of one shape; (..., 4)."""
        found = self.mean[which]
        for k, shown in self.ramps.items():
            own = which == k
            if own.any():
                found[own] = shown[rows[own], columns[own]]
        return found


@dataclass(frozen=True)
class Shares:
    """The pixels of an image as mixtures of two colourings; shape (height, width) each."""

    first: Ints
    """The colouring with the larger share."""
    second: Ints
    """The other one, or the same."""
    share: Floats
    """Share of the first, 1/2 to 1."""
    doubt: Floats
    """How far off that may be, 0 to 1/2."""
    colors: Colors
    """Colours of the colourings."""

    def of(self, number: int, where: tuple[slice, slice]) -> Floats:
        """Return the share of a colouring in the pixels of a part of the image."""
        first, second, share = (each[where] for each in (self.first, self.second, self.share))
        rest = np.where(second == number, 1 - share, 0)
        return np.where(first == number, share, rest).astype(np.float32)


@dataclass(frozen=True)
class _Pairs:
    """For each of some pixels, the best mixture of two colourings so far."""

    first: Ints
    second: Ints
    share: Floats
    """Share of the first."""
    residual: Floats
    """How far off the pixel is [levels]."""
    contrast: Floats
    """How far the two colours are apart [levels]."""
    cost: Floats
    """The residual, and what the distance of the colourings counts [levels]."""


def find_shares(regions: Regions) -> Shares:
    """Return what the pixels of an image are made of, of the colourings of its regions.

    Where an image has no antialiasing, its borders are steps of pixels, and shares are off by up to a half.
    """
    painted = regions.paint[regions.labels]
    colors = Colors.of(regions, painted)
    off = channel_max(np.abs(regions.image - regions.fills))
    rows, columns = np.nonzero(off > ROUNDING + regions.noise)
    pairs = _best_pairs(regions, painted, colors, rows, columns)
    swapped = pairs.share < 0.5
    doubt = OUTLIERS * (pairs.residual + regions.noise) / np.maximum(pairs.contrast, 1)
    found = (
        (painted, np.where(swapped, pairs.second, pairs.first)),
        (painted, np.where(swapped, pairs.first, pairs.second)),
        (np.ones(painted.shape, np.float32), np.where(swapped, 1 - pairs.share, pairs.share)),
        (np.zeros(painted.shape, np.float32), np.minimum(doubt, 0.5)),
    )
    first, second, share, unsure = (_with(whole, rows, columns, values) for whole, values in found)
    if _is_stepped(first, share < 1 - PURE):
        share, unsure = np.ones_like(share), np.full_like(unsure, 0.5)
    # Steps of smooth shading end anywhere between.
    is_band = np.array([coloring.is_band for coloring in regions.colorings])
    unsure[is_band[first] & (share == 1)] = 0.5
    return Shares(first, second, share, unsure, colors)


def _is_stepped(painted: Ints, mixed: Bools) -> bool:
    """Return whether most steps of borders, from one row or column to the next, have no mixed pixel."""
    hard, soft = 0, 0
    for own, between in ((painted, mixed), (painted.T, mixed.T)):
        a, b, c, d = own[:-1, :-1], own[:-1, 1:], own[1:, :-1], own[1:, 1:]
        corners = (a == d) != (b == c)
        odd = np.where(a == d, np.where(a == b, c, b), np.where(b == a, d, a))
        steps = corners[1:] & corners[:-1] & (odd[1:] != odd[:-1])
        near = between[:-1, :-1] | between[:-1, 1:] | between[1:, :-1] | between[1:, 1:]
        near = near[1:] | near[:-1]
        hard, soft = hard + int((steps & ~near).sum()), soft + int((steps & near).sum())
    return hard > soft


def beside_borders(values: Ints) -> Bools:
    """Return the pixels that differ from one of their four neighbours."""
    found = np.zeros(values.shape, np.bool_)
    for one, other in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        differs = values[one] != values[other]
        found[one] |= differs
        found[other] |= differs
    return found


def _with(whole: Any, rows: Ints, columns: Ints, values: Any) -> Any:
    """Return an array with some of its pixels changed."""
    whole = whole.copy()
    whole[rows, columns] = values
    return whole


def _best_pairs(regions: Regions, painted: Ints, colors: Colors, rows: Ints, columns: Ints) -> _Pairs:
    """Return the pair of colourings near each of some pixels whose mixture is nearest to its colour.

    Steps of smooth shading are not mixed with one another.
    """
    numbers, count = numbers_in(painted).tolist(), len(rows)
    pixels, own = regions.image[rows, columns], painted[rows, columns]
    off = channel_max(np.abs(pixels - regions.fills[rows, columns]))
    best = _Pairs(
        own,
        own.copy(),
        np.ones(count, np.float32),
        off,
        np.full(count, 255, np.float32),
        np.full(count, np.inf, np.float32),
    )
    away = [filters.distance(painted != k)[rows, columns] for k in numbers]
    for i, a in enumerate(numbers):
        mine = np.flatnonzero(away[i] < NEAR)
        for j, b in enumerate(numbers[i + 1 :], i + 1):
            if regions.colorings[a].is_band and regions.colorings[b].is_band:
                continue
            some = mine[away[j][mine] < NEAR]
            if not len(some):
                continue
            one, other = (
                colors.ramps[k][rows[some], columns[some]] if k in colors.ramps else colors.mean[k]
                for k in (a, b)
            )
            share, residual = mixed(pixels[some], one, other)
            share = np.clip(share, 0, 1)
            cost = residual + DISTANCE_COST * (away[i] + away[j])[some]
            better = cost < best.cost[some]
            some = some[better]
            best.first[some], best.second[some], best.share[some] = a, b, share[better]
            best.residual[some], best.cost[some] = residual[better], cost[better]
            best.contrast[some] = np.broadcast_to(channel_max(np.abs(one - other)), better.shape)[better]
    return best
