"""Lines and dots too thin to have a seed: pixels that no mixture of the regions around explains."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints
from warpsplat.drawing.trace.mixtures import MIXED, mixed, unmix
from warpsplat.drawing.trace.palette import Coloring, Parts
from warpsplat.scene.scene import numbers_in

ROUNDS = 4  # colours in one thin part, at the most
MOST_PARTS = 4000  # in a round; an image with more is no drawing
SMALL = 8  # [px] of a part that may lie where several regions meet
LARGE = 100  # [px] of a part among whose pixels there may be one more new colour
FAINT = 24.0  # [levels] a small part whose largest residual is less is no part
COVERED = 0.35  # least share of the part's colour in a pixel that belongs to it
COVERED_OF_MOST = 0.8  # or this share of the largest one, if that is less
OTHER_COLOR = 64.0  # [levels] a pixel this far off the part's mixtures has another colour
NO_EVIDENCE = 256  # [levels] residual where there is no region nearby
NEARBY = 5  # [px] how far from a thin part the colours lie that it may be mixed of
MOST_COLORS = 8  # of which triples are tried
MATCHING = 0.8  # share of the least mixed pixels that must be mixed of a colour for it to match
CLEARLY = 0.4  # share of a colour that some pixel must have, for the part to have this colour


@dataclass(frozen=True)
class _ThinPart:
    """Connected pixels that no mixture explains."""

    rows: Ints
    columns: Ints
    colors: Floats
    """Shape (pixel, channel)."""
    bases: Floats
    """The colour of the nearest region, shape (pixel, channel)."""
    residuals: Floats
    """Distance from any mixture [levels], shape (pixel,)."""

    def typical_color(self) -> Floats:
        """Return the median colour of the quarter of the pixels that are least mixed."""
        return np.round(np.median(self.colors[self.least_mixed(0.25)], axis=0))

    def least_mixed(self, share: float) -> Bools:
        """Return the pixels that are least mixed, shape (pixel,); ``share``: of all, about."""
        place = math.ceil((1 - share) * (len(self.residuals) - 1))
        return np.asarray(self.residuals >= np.sort(self.residuals)[place])


class _FlatColors(NamedTuple):
    """The flat ones of some colourings."""

    numbers: list[int]
    colors: Floats
    """Shape (color, channel)."""
    total: int
    """Number of all colourings."""

    @staticmethod
    def of(colorings: list[Coloring]) -> _FlatColors:
        """Return those of ``colorings``."""
        numbers = [i for i, coloring in enumerate(colorings) if coloring.ramp is None]
        return _FlatColors(numbers, np.array([colorings[i].color for i in numbers]), len(colorings))


def add_thin_parts(image: Floats, parts: Parts, noise: float) -> Parts:
    """Label the lines and dots that have no seed.

    A connected part may have several colours, as a thin bar and its outline: its pixels that are not between
    the colour found and what is beside the part make up the parts of the next round. They keep their label
    where no other colour of the image fits them.

    Args:
        image: Shape (height, width, channel).
        parts: What is labelled from seeds.
        noise: Of flat regions [levels].
    """
    waiting = parts.labels == NO_REGION
    for number in range(ROUNDS):
        cleared = replace(parts, labels=np.where(waiting, NO_REGION, parts.labels).astype(np.int32))
        found, unexplained, waiting = _round(image, cleared, noise, waiting, new_colors=number == 0)
        kept = unexplained & (found.labels == NO_REGION)
        parts = replace(
            found,
            labels=np.where(kept, parts.labels, found.labels),
            fills=np.where(kept[..., None], parts.fills, found.fills),
        )
        if not waiting.any():
            break
    return parts


def _round(
    image: Floats, parts: Parts, noise: float, waiting: Bools, *, new_colors: bool
) -> tuple[Parts, Bools, Bools]:
    """Find one colour for each thin part among the pixels that are ``waiting``.

    Returns:
        The parts with the thin ones; the pixels that no mixture explains; those of them that were labelled
        and seem to have another colour. The masks have shape (height, width).
    """
    limit = MIXED + noise
    rows, columns = np.nonzero(waiting)
    mixtures = unmix(image, parts.labels, parts.fills, rows, columns, noise)
    residual = np.zeros(waiting.shape, np.float32)
    residual[rows, columns] = np.where(np.isfinite(mixtures.residual), mixtures.residual, NO_EVIDENCE)
    bases = np.zeros_like(parts.fills)
    bases[rows, columns] = mixtures.base
    unexplained, other = residual > limit, np.zeros_like(waiting)
    labels, fills = parts.labels.copy(), parts.fills.copy()
    paint, colorings = parts.paint.tolist(), list(parts.colorings)
    flat = _FlatColors.of(colorings)
    for y, x in _components_by_size(unexplained):
        thin = _ThinPart(y, x, image[y, x], bases[y, x], residual[y, x])
        near = _flat_colors_near(labels, parts.paint, thin, colorings)
        if len(y) <= SMALL and (
            _is_mixture_of_three(thin.colors, [colorings[i].color for i in near], limit)
            or thin.residuals.max() < FAINT
        ):
            continue
        chosen = _matching_color(thin, flat, near, limit)
        if chosen is None or (chosen == len(colorings) and not new_colors and len(y) < LARGE):
            continue
        if chosen == len(colorings):
            colorings.append(Coloring(thin.typical_color()))
            flat = _FlatColors.of(colorings)
        color = colorings[chosen].color
        share, off = mixed(thin.colors, color, thin.bases)
        own = share >= min(COVERED, COVERED_OF_MOST * float(share.max()))
        other[y, x] = own & (off > OTHER_COLOR)
        labels[y[own], x[own]] = len(paint)
        fills[y[own], x[own]] = color
        paint.append(chosen)
    return Parts(labels, fills, np.asarray(paint, np.int32), colorings), unexplained, other


def _components_by_size(mask: Bools) -> Iterator[tuple[Ints, Ints]]:
    """Yield rows and columns of the connected components of a mask, the largest first."""
    _, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    rows, columns = np.nonzero(mask)
    owner = parts[rows, columns]
    order = np.argsort(owner, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)
    for index in sorted(groups, key=len, reverse=True)[:MOST_PARTS]:
        if len(index):
            yield rows[index], columns[index]


def _flat_colors_near(labels: Ints, paint: Ints, thin: _ThinPart, colorings: list[Coloring]) -> list[int]:
    """Return the numbers of the flat colourings, of parts that have a ``paint``, beside a thin part."""
    y, x = thin.rows, thin.columns
    rows = slice(max(int(y.min()) - NEARBY, 0), int(y.max()) + NEARBY + 1)
    columns = slice(max(int(x.min()) - NEARBY, 0), int(x.max()) + NEARBY + 1)
    seen = labels[rows, columns]
    seen = seen[(seen != NO_REGION) & (seen < len(paint))]
    return [i for i in numbers_in(paint[seen]).tolist() if colorings[i].ramp is None]


def _is_mixture_of_three(pixels: Floats, colors: list[Floats], limit: float) -> bool:
    """Return whether each pixel is a mixture of some three of the colours."""
    if len(colors) < 3:
        return False
    triples = np.array(list(itertools.combinations(colors[:MOST_COLORS], 3)))
    first, second, third = np.moveaxis(triples, 1, 0)[:, :, None]
    one, other, away = second - first, third - first, pixels - first
    # The nearest point in the plane of three colours, or on their line: colours are whole levels, so that
    # the determinant of three on a line is exactly 0.
    a, b, c = ((x * y).sum(axis=2) for x, y in ((one, one), (one, other), (other, other)))
    p, q = (away * one).sum(axis=2), (away * other).sum(axis=2)
    determinant = a * c - b * b
    in_plane = determinant > 0
    scale = np.where(in_plane, determinant, np.maximum(a + c, 1))
    shares = np.where(in_plane, c * p - b * q, p) / scale, np.where(in_plane, a * q - b * p, q) / scale
    off = np.abs(away - shares[0][..., None] * one - shares[1][..., None] * other).max(axis=2)
    inside = (np.minimum(*shares) > -0.05) & (shares[0] + shares[1] < 1.05)
    return bool(((off <= limit) & inside).any(axis=0).all())


def _matching_color(thin: _ThinPart, flat: _FlatColors, near: list[int], limit: float) -> int | None:
    """Return the number of a thin part's colouring, one more than there are for a new one; None for no part.

    A known colour matches if the pixels lie between what is beside them and that colour. If that is a colour
    ``near`` them but their share of it is small, they are the tip of its region, too faint to show.
    """
    if not flat.numbers:
        return flat.total
    top = thin.least_mixed(0.5)
    pixels, bases = thin.colors[top], thin.bases[top]
    most = len(pixels) - int(MATCHING * (len(pixels) - 1))  # pixels that a colour may miss
    few = slice(0, 2 * most)  # which tell of most colours that they miss too many
    likely = np.flatnonzero(
        (mixed(pixels[few, None], flat.colors, bases[few, None])[1] > limit).sum(axis=0) <= most
    )
    share, off = mixed(pixels[:, None], flat.colors[likely], bases[:, None])
    fits, largest = np.zeros(len(flat.colors), np.bool_), np.zeros(len(flat.colors), share.dtype)
    fits[likely] = (off > limit).sum(axis=0) <= most
    largest[likely] = share.max(axis=0)
    if fits.any():
        fits[fits] = np.quantile(off[:, fits[likely]], MATCHING, axis=0) <= limit
    clear = fits & (largest >= CLEARLY)
    if clear.any():
        return flat.numbers[int(np.where(clear, largest, -np.inf).argmax())]
    return None if any(fits[flat.numbers.index(i)] for i in near) else flat.total
