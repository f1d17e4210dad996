"""Shares of colourings in the pixels of an image: each is of one colouring, or a mixture of two."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.assign import main_color
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, channel_max, nearest_of
from warpsplat.drawing.trace.mixtures import unmix
from warpsplat.drawing.trace.regions import Regions
from warpsplat.drawing.trace.seeds import OUTLIERS, ROUNDING
from warpsplat.scene.scene import numbers_in

PURE = 0.02
"""Share of another colouring up to which a pixel is not mixed."""


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

    def of(self, number: int, where: tuple[slice, slice]) -> Floats:
        """Return the share of a colouring in the pixels of a part of the image."""
        first, second, share = (each[where] for each in (self.first, self.second, self.share))
        rest = np.where(second == number, 1 - share, 0)
        return np.where(first == number, share, rest).astype(np.float32)


def find_shares(regions: Regions) -> Shares:
    """Return what the pixels of an image are made of, of the colourings of its regions.

    Where an image has no antialiasing, its borders are steps of pixels, and shares are off by up to a half.
    """
    painted = regions.paint[regions.labels]
    is_band = np.array([coloring.is_band for coloring in regions.colorings])
    first, second = painted.copy(), painted.copy()
    share, unsure = np.ones(painted.shape, np.float32), np.zeros(painted.shape, np.float32)
    is_off = channel_max(np.abs(regions.image - regions.fills)) > ROUNDING + regions.noise
    inside = np.zeros(painted.shape, np.bool_)
    inside[1:-1, 1:-1] = True
    # A strip along the border of an image may show the last of what lies beyond, mostly the main colour.
    for where, main in ((inside, None), (~inside, main_color(painted, regions.colorings))):
        some = rows, columns = np.nonzero(is_off & where)
        # Steps of smooth shading are not mixed with one another.
        found = unmix(regions.image, painted, regions.fills, rows, columns, apart=is_band, main=main)
        first[some], second[some], share[some] = found.label, found.other, found.share
        contrast = np.where(found.label == found.other, 255, np.maximum(found.contrast, 1))
        unsure[some] = np.minimum(OUTLIERS * (found.residual + regions.noise) / contrast, 0.5)
    if _is_stepped(first, share < 1 - PURE):
        share, unsure = np.ones_like(share), np.full_like(unsure, 0.5)
    # They end anywhere between.
    unsure[is_band[first] & (share == 1)] = 0.5
    return Shares(first, second, share, unsure)


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


def colors_at(regions: Regions, which: Ints, rows: Ints, columns: Ints) -> Floats:
    """Return the colours of the colourings ``which`` in some pixels, all of one shape; (..., 4).

    Outside their own pixels gradients have the colour of the nearest one.
    """
    painted, fills = regions.paint[regions.labels], regions.fills.reshape(-1, regions.fills.shape[2])
    found = np.array([coloring.color for coloring in regions.colorings], np.float32)[which]
    for k in numbers_in(which).tolist():
        if regions.colorings[k].ramp is not None:
            own = which == k
            found[own] = fills[nearest_of(painted == k, rows[own], columns[own])]
    return found
