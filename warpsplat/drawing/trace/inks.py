"""Inks: the colours of thin parts, of which no pixel may be covered altogether."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from warpsplat.drawing import prices
from warpsplat.drawing.trace.grids import (
    NO_REGION,
    Bools,
    Floats,
    Ints,
    channel_max,
    components,
    dilated,
    eroded,
)
from warpsplat.drawing.trace.mixtures import MIXED, REACH, mixed, neighbours
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.regions import Regions
from warpsplat.scene.scene import numbers_in

ALONG = 5  # [px] side of the square within which a thin part has one ink
STEP = 16  # [levels] between colours of thin parts that are tried as inks
TRIED = 48  # of them, the most frequent ones
LEAST_INK = 0.4  # share of an ink in a colour that is taken for a mixture with it
SOLID = 40  # [px] in a row or area of one colour that is no mixture
DARKEST = 3  # pixels whose median is the ink


def with_inks(regions: Regions) -> Regions:
    """Return clean regions with one ink for all thin parts that show more or less of it.

    More inks are added where they explain the thin parts of the whole picture so much better that they are
    worth their bytes: lines of several colours that touch are one part.
    """
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
        share, off = mixed(colors[k], np.array([colors[j] for j in inks]), bases[k])
        off = np.where(share >= LEAST_INK, off, np.inf)
        if off.min() <= MIXED:
            paint[regions.paint == k] = inks[off.argmin()]
        else:
            inks.append(k)
            colorings[k] = replace(colorings[k], color=colors[k])
    where = np.isin(painted, sorted(bases))
    return _with_more_inks(replace(regions, paint=paint, colorings=colorings), where)


def _with_more_inks(regions: Regions, where: Bools) -> Regions:
    """Return regions whose thin parts, which are ``where``, have more inks if these are worth their bytes."""
    painted = regions.paint[regions.labels]
    pixels = _ThinPixels.of(regions, painted, where)
    tried, own = pixels.usual_colors(), painted[where]
    errors, left = [pixels.errors(ink) for ink in tried], np.zeros(len(own))
    for k in numbers_in(own).tolist():
        left[own == k] = pixels.errors(regions.colorings[k].color)[own == k]
    colorings, values, parts = list(regions.colorings), 3 * where.size * 255.0**2, pixels.parts(own)
    while True:
        best = max(range(len(tried)), key=lambda i: float(np.maximum(left - errors[i], 0).sum()))
        nearer = pixels.along(errors[best]) < pixels.along(left)
        changed = np.where(nearer, len(colorings), own)
        after, count = np.where(nearer, errors[best], left), pixels.parts(changed)
        size = prices.REGION * (pixels.others + max(parts, count))
        byte = prices.worth(float(left.sum()) / values, size)
        if float((left - after).sum()) / values <= prices.REGION * max(count - parts, 1) * byte:
            break
        colorings.append(Coloring(np.round(tried[best])))
        own, left, parts = changed, after, count
    if len(colorings) == len(regions.colorings):
        return regions
    painted, fills = painted.copy(), regions.fills.copy()
    painted[where] = own
    fills[where] = np.array([coloring.color for coloring in colorings])[own]
    labels = components(painted, regions.image)
    paint = np.zeros(int(labels.max()) + 1, np.int32)
    paint[labels] = painted
    return replace(regions, labels=labels, fills=fills, paint=paint, colorings=colorings)


@dataclass(frozen=True)
class _ThinPixels:
    """The pixels of thin parts, and what is beside them."""

    where: Bools
    """Shape (height, width)."""
    kinds: Ints
    """The colouring that each pixel of the image had, shape (height, width)."""
    others: int
    """Regions that are not thin."""
    colors: Floats
    """Shape (pixel, channel)."""
    owners: Ints
    """For each colour beside a pixel, the pixel; shape (base,)."""
    bases: Floats
    """The colours beside them, shape (base, channel)."""

    @staticmethod
    def of(regions: Regions, painted: Ints, where: Bools) -> _ThinPixels:
        """Return some pixels of an image; ``painted``: the colouring of each of its pixels."""
        rows, columns = np.nonzero(where)
        found, index, _ = neighbours(np.where(where, NO_REGION, painted), rows, columns, REACH)
        known = found != NO_REGION
        pair = np.nonzero(known)[1] * len(regions.colorings) + found[known]
        first = np.unique(pair, return_index=True)[1]
        bases = regions.fills.reshape(-1, regions.fills.shape[2])[index[known][first]]
        others = len(numbers_in(regions.labels[~where]))
        owners = np.nonzero(known)[1][first]
        return _ThinPixels(where, painted, others, regions.image[where], owners, bases)

    def usual_colors(self) -> Floats:
        """Return the most frequent colours, about, shape (color, channel)."""
        cells = np.round(self.colors / STEP)
        _, owner, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        usual = np.argsort(-counts, kind="stable")[:TRIED].tolist()
        return np.array([self.colors[owner.reshape(-1) == i].mean(axis=0) for i in usual])

    def errors(self, ink: Floats) -> Floats:
        """Return the squared error of each pixel as a mixture with an ink, shape (pixel,)."""
        error = ((self.colors - ink) ** 2).sum(axis=1)
        pixels = self.colors[self.owners]
        share = np.clip(mixed(pixels, ink, self.bases)[0], 0, 1)
        off = ((pixels - self.bases - share[:, None] * (ink - self.bases)) ** 2).sum(axis=1)
        np.minimum.at(error, self.owners, off)
        return error

    def along(self, values: Floats) -> Floats:
        """Return the sum of values along the thin part that each pixel is in, shape (pixel,)."""
        height, width = self.kinds.shape
        reach = ALONG // 2
        padded = np.pad(self.kinds, reach, constant_values=NO_REGION)
        grid = np.zeros(padded.shape, np.float64)
        grid[reach : reach + height, reach : reach + width][self.where] = values
        rows, columns = np.nonzero(self.where)
        own, total = self.kinds[self.where], np.zeros(len(values))
        for down in range(ALONG):
            for right in range(ALONG):
                place = rows + down, columns + right
                total += np.where(padded[place] == own, grid[place], 0)
        return total

    def parts(self, inks: Ints) -> int:
        """Return how many connected parts pixels of some inks make up."""
        painted = np.full(self.where.shape, NO_REGION, np.int32)
        painted[self.where] = inks
        parts = components(painted, np.zeros((*painted.shape, 1), np.float32))
        return len(numbers_in(parts[self.where]))


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
