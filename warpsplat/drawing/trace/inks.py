"""Inks: the colours of thin parts, of which no pixel may be covered altogether."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, channel_max, dilated, eroded
from warpsplat.drawing.trace.mixtures import MIXED
from warpsplat.drawing.trace.regions import Regions
from warpsplat.scene.scene import numbers_in

LEAST_INK = 0.4  # share of an ink in a colour that is taken for a mixture with it
SOLID = 40  # [px] in a row or area of one colour that is no mixture
DARKEST = 3  # pixels whose median is the ink


def with_inks(regions: Regions) -> Regions:
    """Return clean regions with one ink for all thin parts that show more or less of it."""
    painted = regions.paint[regions.labels]
    flat = [k for k in numbers_in(painted).tolist() if regions.colorings[k].ramp is None]
    colors = {k: regions.colorings[k].color for k in flat}
    solid = [k for k in flat if _is_solid(regions.image, painted == k, colors[k])]
    if not solid or len(solid) == len(flat):
        return regions
    bases = {}
    for k in set(flat) - set(solid):
        own = painted == k
        beside = painted[dilated(own, 5) & ~own]
        bases[k] = base = colors[max(solid, key=lambda j: int((beside == j).sum()))]
        toward = colors[k] - base
        pixels = regions.image[own]
        share = ((pixels - base) * toward).sum(axis=1) / max(float((toward**2).sum()), 1.0)
        off = channel_max(np.abs(pixels - base - share[:, None] * toward))
        # What is more of a colour than the usual one is off by as much more.
        near = off <= np.maximum(share, 1) * (1 + regions.noise)
        pixels = pixels[near] if near.any() else pixels
        order = np.argsort(-((pixels - base) ** 2).sum(axis=1), kind="stable")
        colors[k] = np.round(np.median(pixels[order[:DARKEST]], axis=0))
    paint, colorings, inks = regions.paint.copy(), list(regions.colorings), list(solid)
    for k in sorted(bases, key=lambda k: (-float(((colors[k] - bases[k]) ** 2).sum()), k)):
        offs = {j: _off(colors[k] - bases[k], colors[j] - bases[k]) for j in inks}
        ink = min(offs, key=offs.__getitem__)
        if offs[ink] <= MIXED:
            paint[regions.paint == k] = ink
        else:
            inks.append(k)
            colorings[k] = replace(colorings[k], color=colors[k])
    return replace(regions, paint=paint, colorings=colorings)


def _is_solid(image: Floats, own: Bools, color: Floats) -> bool:
    """Return whether a colour covers an area, or a line as long as no letter's."""
    rows, columns = np.flatnonzero(own.any(axis=1)), np.flatnonzero(own.any(axis=0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    image, own = image[box], own[box]
    inner = np.flatnonzero(eroded(own, 3))
    if len(inner):  # one place is likely to tell, at a fraction of the time
        y, x = divmod(int(inner[len(inner) // 2]), own.shape[1])
        near = image[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        if np.abs(near - color).max() <= MIXED:
            return True
    exact = own & (channel_max(np.abs(image - color)) <= MIXED)
    if eroded(exact, 3).any():
        return True
    _, _, stats, _ = cv2.connectedComponentsWithStats(exact.astype(np.uint8), connectivity=8)
    return bool((stats[1:, cv2.CC_STAT_AREA] >= SOLID).any())


def _off(away: Floats, toward: Floats) -> float:
    """Return how far a colour is from all mixtures that have enough of an ink [levels]; all from the base."""
    share = float((away * toward).sum()) / max(float((toward**2).sum()), 1.0)
    return float(np.abs(away - min(share, 1.0) * toward).max()) if share >= LEAST_INK else np.inf
