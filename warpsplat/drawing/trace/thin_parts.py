"""Lines and dots too thin to have a seed: pixels that no mixture of the regions around explains."""

from __future__ import annotations

import math
from collections.abc import Iterator

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints
from warpsplat.drawing.trace.mixtures import MIXED, mixed, unmix
from warpsplat.drawing.trace.palette import Coloring, Parts, least_worth

MOST_PARTS = 4000  # that are looked at, the largest first; an image with more is no drawing
COVERED = 0.35  # least share of the part's colour in a pixel that belongs to it
COVERED_OF_MOST = 0.8  # or this share of the largest one, if that is less
MATCHING = 0.8  # share of the least mixed pixels that must be mixed of a colour for it to match


def add_thin_parts(image: Floats, parts: Parts, noise: float) -> Parts:
    """Label the lines and dots that have no seed: each connected part of them has one colour.

    Args:
        image: Shape (height, width, channel).
        parts: What is labelled from seeds.
        noise: Of flat regions [levels].
    """
    limit = MIXED + noise
    rows, columns = np.nonzero(parts.labels == NO_REGION)
    mixtures = unmix(image, parts.labels, parts.fills, rows, columns, noise)
    residual, bases = np.zeros(parts.labels.shape, np.float32), np.zeros_like(parts.fills)
    residual[rows, columns], bases[rows, columns] = mixtures.residual, mixtures.base
    labels, fills = parts.labels.copy(), parts.fills.copy()
    paint, colorings = parts.paint.tolist(), list(parts.colorings)
    flat = [i for i, coloring in enumerate(colorings) if coloring.ramp is None]
    for y, x in _components_by_size(residual > limit):
        if np.square(residual[y, x]).sum() <= least_worth(len(paint), residual.size, noise, negligible=0):
            continue
        pixels, beside, off = image[y, x], bases[y, x], residual[y, x]
        top = _highest(off, 0.5)
        known = np.array([colorings[i].color for i in flat])
        chosen = _matching_color(pixels[top], beside[top], known, limit)
        if chosen is None:
            chosen = len(flat)
            flat.append(len(colorings))
            colorings.append(Coloring(np.round(np.median(pixels[_highest(off, 0.25)], axis=0))))
        color = colorings[flat[chosen]].color
        share, _ = mixed(pixels, color, beside)
        own = share >= min(COVERED, COVERED_OF_MOST * float(share.max()))
        labels[y[own], x[own]] = len(paint)
        fills[y[own], x[own]] = color
        paint.append(flat[chosen])
    return Parts(labels, fills, np.asarray(paint, np.int32), colorings)


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


def _highest(values: Floats, share: float) -> Bools:
    """Return which values are the highest, shape (n,); ``share``: of all, about."""
    return np.asarray(values >= np.sort(values)[math.ceil((1 - share) * (len(values) - 1))])


def _matching_color(pixels: Floats, bases: Floats, colors: Floats, limit: float) -> int | None:
    """Return the number of the colour that has the largest share in some pixel of those that match, or None.

    A colour matches if the pixels lie between what is beside them and that colour.
    """
    if not len(colors):
        return None
    share, off = mixed(pixels[:, None], colors, bases[:, None])
    fits = np.quantile(off, MATCHING, axis=0) <= limit
    return int(np.where(fits, share.max(axis=0), -np.inf).argmax()) if fits.any() else None
