"""Pens of line art: their colours, and widths in steps."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Floats, Ints, at_pixels
from warpsplat.portable.filters import lab
from warpsplat.scene import FloatArray

ALIKE = 30.0  # distance in CIELAB, lightness counted by half, up to which two inks are one pen
SELDOM = 0.015  # share of the length of all lines that a pen has, at the least


def line_colors(lines: list[Floats], ink: Ink) -> tuple[FloatArray, Floats]:
    """Return the ink's colour along each line, where it covers most, and the lines' lengths.

    Args:
        lines: Places [px], shape (point, 2) each.
        ink: Of the image.

    Returns:
        sRGB in [0, 1], shape (line, 3), and [px], shape (line,).
    """
    colors = np.zeros((len(lines), 3), np.float32)
    paper = np.median(ink.shown[~ink.mask], axis=0) if not ink.mask.all() else np.ones(3)
    for number, line in enumerate(lines):
        cover = at_pixels(ink.cover, line)
        best = cover >= np.median(cover)
        share = np.maximum(cover[best], 0.1)[:, None]  # of the line in its pixels, besides paper
        colors[number] = np.median(paper + (at_pixels(ink.shown, line[best]) - paper) / share, axis=0)
    colors = np.clip(colors, 0, 1)
    return colors, np.array([len(line) for line in lines], np.float64)


def find_pens(colors: FloatArray, weights: Floats) -> tuple[FloatArray, Ints]:
    """Return the colours of the pens that lines are drawn with, and each line's pen; the most used first.

    Args:
        colors: Of the lines, sRGB in [0, 1], shape (line, 3).
        weights: Their lengths, shape (line,).
    """
    if not len(colors):
        return np.zeros((0, 3), np.float32), np.zeros(0, np.intp)
    owner = grouped(lab(colors) * np.array([0.5, 1, 1], np.float32), weights, ALIKE, SELDOM * weights.sum())
    order = np.argsort(-np.bincount(owner, weights), kind="stable")
    owner = np.argsort(order, kind="stable")[owner]
    pens = [_weighted_median(colors[owner == pen], weights[owner == pen]) for pen in range(len(order))]
    return np.stack(pens).astype(np.float32), owner


def grouped(places: Floats, weights: Floats, alike: float, seldom: float = 0.0) -> Ints:
    """Return the group of each place: what is nearest to one of those of large weights that are unlike.

    Args:
        places: Shape (place, n).
        weights: Shape (place,).
        alike: Distance up to which two are alike.
        seldom: Least weight of a group, unless none has more.
    """
    centers = np.zeros((0, places.shape[1]))
    for place in places[np.argsort(-weights, kind="stable")]:
        if not (np.linalg.norm(centers - place, axis=1) <= alike).any():
            centers = np.vstack([centers, place])
    used = np.bincount(_nearest(places, centers), weights, len(centers))
    return _nearest(places, centers[used >= min(seldom, used.max())])


def _nearest(places: Floats, centers: Floats) -> Ints:
    """Return the nearest centre of each place."""
    return np.linalg.norm(places[:, None] - centers[None], axis=2).argmin(axis=1)


def _weighted_median(values: FloatArray, weights: Floats) -> Floats:
    """Return the weighted median of each column."""
    order = np.argsort(values, axis=0, kind="stable")
    sums = np.cumsum(weights[order], axis=0)
    middle = (sums >= 0.5 * sums[-1]).argmax(axis=0)
    return np.asarray(np.take_along_axis(values, np.take_along_axis(order, middle[None], 0), 0)[0])
