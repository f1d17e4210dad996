"""Lines and dots too thin to have a seed: pixels that no mixture of the regions around explains."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields, replace

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints, channel_max, dilated, nearest_in
from warpsplat.drawing.trace.mixtures import MIXED, REACH, mixed, unmix
from warpsplat.drawing.trace.palette import Coloring, Parts, least_worth
from warpsplat.portable import filters

COVERED = 0.35  # least share of an ink in a pixel for it to belong to a part, or to a line to be of the ink
ALONG = 5  # [px] side of the square in which these are compared
STEP = 16  # [levels] between colours that are told apart
TRIED = 32  # colours of pixels, and pairs of these and what is beside, from which inks are sought
PARALLEL = 0.01  # squared sine of the angle below which two mixtures do not tell where they meet
WITHIN = 0.03  # what a squared error within the limit counts for, over one beyond it
EQUAL = 0.25  # of the limit: mixtures that are less off are as good as exact
FEWEST = 4  # pixels of 3x3 that have the colour of a distant region, so that it is no chance
SAMPLES, BLOCK = 1 << 16, 32  # pixels by which inks are judged, about, in blocks of so many along a side


def add_thin_parts(image: Floats, parts: Parts, noise: float) -> Parts:
    """Label the lines and dots that have no seed.

    Their inks are colours of the image, and others where they explain so much more that they are worth a
    region. No pixel may be covered altogether by an ink, but where it lies on several colours all its
    mixtures with them point to it.

    Args:
        image: Shape (height, width, channel).
        parts: What is labelled from seeds.
        noise: Of flat regions [levels].
    """
    parts = _with_distant_pixels(image, parts, MIXED + noise)
    rows, columns = np.nonzero(parts.labels == NO_REGION)
    mixtures = unmix(image, parts.labels, parts.fills, rows, columns, noise)
    is_off = mixtures.residual > MIXED + noise
    if not is_off.any():
        return parts
    rows, columns = rows[is_off], columns[is_off]
    off, beside = mixtures.residual[is_off], mixtures.base[is_off]
    shown = image[rows, columns]
    main = parts.colorings[parts.paint[np.bincount(parts.labels[parts.labels != NO_REGION]).argmax()]].color
    # What has no region near it lies on the main one.
    is_alone = np.isinf(off)
    beside[is_alone] = main
    off[is_alone] = channel_max(np.abs(shown - beside))[is_alone]
    thin = _ThinParts(rows, columns, shown, beside, off)
    find = _Explanations(main, parts.labels.shape, MIXED + noise)
    inks = {k: coloring.color for k, coloring in enumerate(parts.colorings) if coloring.ramp is None}
    colorings = list(parts.colorings)
    new, least = find.new_inks(thin, list(inks.values()), len(parts.paint), noise)
    for color in new:
        inks[len(colorings)] = color
        colorings.append(Coloring(color))
    if not inks:
        return parts
    ink = find.best(thin, inks, least)
    labels, fills, paint = parts.labels.copy(), parts.fills.copy(), parts.paint.tolist()
    for k in np.unique(ink[ink != NO_REGION]).tolist():
        place = rows[ink == k], columns[ink == k]
        labels[place], fills[place] = len(paint), inks[k]
        paint.append(k)
    return Parts(labels, fills, np.asarray(paint, np.int32), colorings)


def _with_distant_pixels(image: Floats, parts: Parts, limit: float) -> Parts:
    """Return parts with the pixels that are far from all, but have the colour of the nearest: between lines.

    ``limit``: how far off it may be [levels].
    """
    known = parts.labels != NO_REGION
    far = np.nonzero(~dilated(known, 2 * REACH + 1))
    if not len(far[0]):
        return parts
    nearest = np.unravel_index(nearest_in(known)[far], known.shape)
    found = np.zeros(known.shape)
    found[far] = channel_max(np.abs(image[far] - parts.fills[nearest])) <= limit
    # Lone pixels may be mixtures of that colour by chance.
    alike = (found[far] > 0) & (filters.box_sum(found, 3)[far] >= FEWEST)
    labels, fills = parts.labels.copy(), parts.fills.copy()
    own, source = ((rows[alike], columns[alike]) for rows, columns in (far, nearest))
    labels[own], fills[own] = labels[source], fills[source]
    return replace(parts, labels=labels, fills=fills)


@dataclass(frozen=True)
class _ThinParts:
    """Pixels that no mixture of the regions around explains; shape (pixel, ...) each."""

    rows: Ints
    columns: Ints
    shown: Floats
    """Their colours."""
    beside: Floats
    """The colour of the nearest region."""
    off: Floats
    """How far off the best mixture is [levels]."""

    def sampled(self) -> _ThinParts:
        """Return the pixels in some blocks of the image, about ``SAMPLES`` if there are more."""
        count = 1 + len(self.rows) // SAMPLES
        diagonal = (self.rows // BLOCK + self.columns // BLOCK) % count
        some = diagonal == np.bincount(diagonal).argmax()
        return _ThinParts(*(getattr(self, field.name)[some] for field in fields(self)))


@dataclass(frozen=True)
class _Explanations:
    """Inks as explanations of thin parts: each pixel is a mixture of an ink and what is beside it."""

    main: Floats
    """The main colour of the image, which may be mixed with an ink wherever it is, if nothing else is."""
    shape: tuple[int, ...]
    """Height and width of the image."""
    limit: float
    """How far off mixtures may be [levels]."""

    def explain(self, thin: _ThinParts, ink: Floats) -> tuple[Floats, Floats]:
        """Return the share of an ink in each pixel, and how far off the mixture is [levels]."""
        share, off = mixed(thin.shown, ink, thin.beside)
        of_main, main_off = mixed(thin.shown, ink, self.main)
        main_off += 2 * self.limit
        share = np.clip(np.where(main_off < off, of_main, share), 0, 1)
        # A faint line is none of an ink that is clear nowhere along it.
        clearest = cv2.dilate(self._grid(thin, share, np.float32), np.ones((ALONG, ALONG), np.uint8))
        is_clear = clearest[thin.rows, thin.columns] >= COVERED
        return share, np.where(is_clear, np.minimum(np.minimum(off, main_off), thin.off), thin.off)

    def new_inks(
        self, thin: _ThinParts, known: list[Floats], regions: int, noise: float
    ) -> tuple[list[Floats], float]:
        """Return the colours besides those ``known`` that are worth a region each, the best one first.

        Returns:
            The colours, and the squared error that a region must save then [levels squared].
        """
        some = thin.sampled()
        part = len(some.rows) / len(thin.rows)
        count, owner, _ = self._components(some, np.ones(len(some.rows), np.bool_))
        left = self._visible(some.off)
        for ink in known:
            left = np.minimum(left, self._visible(self.explain(some, ink)[1]))
        tried = _candidates(some, self.limit)
        errors, inexact = list[Floats](), list[float]()
        for ink in tried:
            off = self.explain(some, ink)[1]
            errors.append(self._visible(off).astype(np.float32))
            inexact.append(float(np.square(np.minimum(off, self.limit)).sum()))
        found = list[Floats]()
        pixels = int(self.shape[0] * self.shape[1] * part)
        # What no ink explains is an error that remains in any case.
        remaining = np.minimum(left, np.min(errors, axis=0)).sum()
        spread = float(np.sqrt(noise * noise + remaining / pixels))
        while True:
            least = least_worth(regions + len(found), pixels, spread)
            # A part for which an ink explains less than a region is worth does not count.
            gains = [np.bincount(owner, np.maximum(left - error, 0), count) for error in errors]
            totals = np.array([np.maximum(gain - least, 0).sum() for gain in gains])
            best = int(totals.argmax())
            if totals[best] <= 0:
                return found, least / part
            # Of those that explain as much, but for the worth of a region, the most exact one is the ink.
            close = np.flatnonzero(totals >= totals[best] - least).tolist()
            as_good = [i for i in close if np.maximum(errors[i] - errors[best], 0).sum() <= least]
            best = min(as_good, key=inexact.__getitem__)
            found.append(tried[best])
            left = np.minimum(left, errors[best])

    def _visible(self, off: Floats) -> Floats:
        """Return the squared errors of mixtures that are ``off``, which count for little within the limit."""
        return np.square(np.maximum(off - self.limit, 0)) + WITHIN * np.square(off)

    def best(self, thin: _ThinParts, inks: dict[int, Floats], least: float) -> Ints:
        """Return the number of the ink of each pixel; NO_REGION where none covers enough of it.

        Each connected part has one ink, if any: of those that explain it as well the one that covers most.
        Pieces of it have another if that explains them so much better that it is worth a region.

        Args:
            thin: The pixels.
            inks: By their numbers.
            least: The squared error that a region must save [levels squared].
        """
        count, owner, sizes = self._components(thin, np.ones(len(thin.rows), np.bool_))
        covered, errors = np.zeros((2, len(inks), count))
        for i, ink in enumerate(inks.values()):
            share, off = self.explain(thin, ink)
            covered[i], errors[i] = np.bincount(owner, share, count), np.bincount(owner, off * off, count)
        slack = np.minimum(least, sizes * (EQUAL * self.limit) ** 2)
        most = np.where(errors <= errors.min(axis=0) + slack, covered, -1).argmax(axis=0)
        error = np.square(thin.off, dtype=np.float64)
        is_worth = np.bincount(owner, error, count) - errors.min(axis=0) > least
        chosen, covers = np.where(is_worth, most, NO_REGION)[owner], np.zeros(len(owner))
        order = np.argsort(errors.sum(axis=1), kind="stable").tolist()
        for revised in (False, True):
            for i in order:
                share, off = self.explain(thin, list(inks.values())[i])
                own = chosen == i
                if revised:
                    if np.maximum(error - off * off, 0).sum() <= least:
                        continue
                    better = ~own & (self._along(thin, error) > self._along(thin, off * off))
                    count, piece, _ = self._components(thin, better)
                    own = better & (np.bincount(piece, better * (error - off * off), count) > least)[piece]
                chosen[own], covers[own], error[own] = i, share[own], np.square(off)[own]
        return np.where(covers >= COVERED, np.array(list(inks))[chosen], NO_REGION)

    def _components(self, thin: _ThinParts, some: Bools) -> tuple[int, Ints, Ints]:
        """Return how many connected components ``some`` pixels make up, the one of each, and their sizes."""
        grid = self._grid(thin, some, np.uint8)
        count, numbers = cv2.connectedComponents(grid, connectivity=8, ltype=cv2.CV_32S)
        found: Ints = numbers[thin.rows, thin.columns].astype(np.intp)
        return count, found, np.bincount(found, minlength=count)

    def _along(self, thin: _ThinParts, values: Floats) -> Floats:
        """Return the sums of values near each pixel, in whole numbers."""
        sums = filters.box_sum(self._grid(thin, values, np.float64), ALONG)
        return np.round(sums[thin.rows, thin.columns])

    def _grid(self, thin: _ThinParts, values: Floats | Bools, kind: type) -> Floats:
        """Return values of pixels as an image that is 0 elsewhere."""
        grid: Floats = np.zeros(self.shape, kind)
        grid[thin.rows, thin.columns] = values
        return grid


def _candidates(thin: _ThinParts, limit: float) -> list[Floats]:
    """Return colours that may be inks: the most frequent ones, and those where mixtures on two colours meet.

    ``limit``: how far off mixtures may be [levels].
    """

    def dot(one: Floats, other: Floats) -> float:
        return float((one * other).sum())

    found = list(_usual(thin.shown))
    pairs = np.split(_usual(np.concatenate([thin.shown, thin.beside], axis=1)), 2, axis=1)
    for (one, base), (other, ground) in itertools.combinations(zip(*pairs, strict=True), 2):
        # The ink is base + s * toward, and ground + t * along.
        toward, along, between = one - base, other - ground, ground - base
        square, across, length = dot(toward, toward), dot(toward, along), dot(along, along)
        det = square * length - across * across
        if det <= PARALLEL * square * length:
            continue
        s = (length * dot(toward, between) - across * dot(along, between)) / det
        t = (across * dot(toward, between) - square * dot(along, between)) / det
        first, second = base + s * toward, ground + t * along
        ink = np.clip((first + second) / 2, 0, 255)
        # No share is much more than 1.
        if min(s, t) >= 1 - COVERED and max(abs(first - ink).max(), abs(second - ink).max()) <= limit:
            found.append(ink)
    return list(np.unique(np.round(found), axis=0))


def _usual(values: Floats) -> Floats:
    """Return the most frequent ones among rows of values [levels], about, shape (value, column)."""
    _, owner, counts = np.unique(np.round(values / STEP), axis=0, return_inverse=True, return_counts=True)
    usual = np.argsort(-counts, kind="stable")[:TRIED].tolist()
    return np.array([values[owner.reshape(-1) == i].mean(axis=0) for i in usual])
