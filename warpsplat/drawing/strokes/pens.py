"""What lines are drawn with: the colours of the pens, and widths in steps."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.portable.elementary import exp, log
from warpsplat.portable.filters import lab
from warpsplat.scene import FloatArray

ALIKE = 30.0
"""Distance in CIELAB, lightness counted by half, up to which two inks are one pen."""

WHOLE, LEAST_SHARE = 0.85, 0.1
"""Cover of a line's pixels from which on they have its colour, and from which on that can be told."""

SELDOM = 0.015
"""Share of the length of all lines that a pen has at the least."""

MOST = 8
"""Pens."""

STEP = 0.12
"""Deviation of the logarithm of a line's width from which on it is drawn in steps."""

SHORTEST = 3.0
"""Length of a step, over the line's width, at the least."""


def line_colors(lines: list[Floats], ink: Ink) -> tuple[FloatArray, Floats]:
    """The ink's colour along each line, where it covers most, and the lines' lengths.

    Args:
        lines: places [px], shape (point, 2) each.
        ink: of the picture.

    Returns:
        sRGB in [0, 1], shape (line, 3), and [px], shape (line,).
    """
    height, width = ink.mask.shape
    colors = np.zeros((len(lines), 3), np.float32)
    paper = np.median(ink.shown[~ink.mask], axis=0) if not ink.mask.all() else np.ones(3)
    for number, line in enumerate(lines):
        columns = np.clip(line[:, 0].astype(np.intp), 0, width - 1)
        rows = np.clip(line[:, 1].astype(np.intp), 0, height - 1)
        cover = ink.cover[rows, columns]
        best = cover >= np.quantile(cover, 0.7)
        seen = np.median(ink.shown[rows[best], columns[best]], axis=0)
        share = float(np.median(cover[best]))
        # What covers no pixel is mixed with the paper.
        colors[number] = (
            np.clip(paper + (seen - paper) / share, 0, 1) if LEAST_SHARE < share < WHOLE else seen
        )
    return colors, np.array([len(line) for line in lines], np.float64)


def find_pens(colors: FloatArray, weights: Floats) -> tuple[FloatArray, Ints]:
    """The colours of the pens that lines are drawn with, and each line's pen; most used first.

    Args:
        colors: of the lines, sRGB in [0, 1], shape (line, 3).
        weights: their lengths, shape (line,).
    """
    if not len(colors):
        return np.zeros((0, 3), np.float32), np.zeros(0, np.intp)
    places = lab(colors) * np.array([0.5, 1, 1], np.float32)
    total = weights.sum()
    leaders: list[int] = []
    for line in np.argsort(-weights, kind="stable").tolist():
        away = np.linalg.norm(places[leaders] - places[line], axis=1) if leaders else np.array([np.inf])
        if away.min() > ALIKE and len(leaders) < MOST:
            leaders.append(line)
    centers = places[leaders]
    owner = np.zeros(len(places), np.intp)
    for _ in range(5):
        owner = np.linalg.norm(places[:, None] - centers[None], axis=2).argmin(axis=1)
        used = np.bincount(owner, weights, len(centers))
        kept = used >= min(SELDOM * total, used.max())
        means = [
            np.average(places[owner == pen], axis=0, weights=weights[owner == pen])
            for pen in np.flatnonzero(kept)
        ]
        centers = _apart(np.array(means), used[kept])
    owner = np.linalg.norm(places[:, None] - centers[None], axis=2).argmin(axis=1)
    order = np.argsort(-np.bincount(owner, weights, len(centers)), kind="stable")
    owner = np.argsort(order, kind="stable")[owner]
    pens = np.stack(
        [_weighted_median(colors[owner == pen], weights[owner == pen]) for pen in range(len(order))]
    )
    return pens.astype(np.float32), owner


def _apart(centers: Floats, used: Floats) -> Floats:
    """The centres that no more used one is alike, in their order."""
    held: list[int] = []
    for pen in np.argsort(-used, kind="stable").tolist():
        if not held or np.linalg.norm(centers[held] - centers[pen], axis=1).min() > ALIKE:
            held.append(pen)
    return centers[sorted(held)]


def _weighted_median(values: FloatArray, weights: Floats) -> Floats:
    """Of each column."""
    order = np.argsort(values, axis=0, kind="stable")
    sums = np.cumsum(weights[order], axis=0)
    middle = (sums >= 0.5 * sums[-1]).argmax(axis=0)
    return np.asarray(np.take_along_axis(values, np.take_along_axis(order, middle[None], 0), 0)[0])


def width_steps(widths: Floats, spacing: float) -> list[tuple[int, int, float]]:
    """Parts of a line that have one width each: first point, last point, width.

    Args:
        widths: at the points of a line [px], shape (point,).
        spacing: of the points [px].
    """
    logs = log(np.maximum(widths, 0.25))
    sums = np.concatenate([[0.0], np.cumsum(logs)])
    squares = np.concatenate([[0.0], np.cumsum(logs**2)])

    def error(low: Ints, high: Ints) -> Floats:
        """Squared deviations of the points from ``low`` to before ``high``."""
        total = sums[high] - sums[low]
        return np.asarray(squares[high] - squares[low] - total * total / np.maximum(high - low, 1))

    def parts(low: int, high: int) -> list[tuple[int, int]]:
        whole = float(error(np.array(low), np.array(high)))
        if whole <= STEP * STEP * (high - low):
            return [(low, high)]
        least = max(2, round(SHORTEST * float(exp(logs[low:high].mean())) / max(spacing, 1e-6)))
        cuts = np.arange(low + least, high - least + 1)
        if not len(cuts):
            return [(low, high)]
        cut = int(cuts[(error(np.array(low), cuts) + error(cuts, np.array(high))).argmin()])
        return [*parts(low, cut), *parts(cut, high)]

    return [
        (low, min(high, len(widths) - 1), float(exp(np.median(logs[low:high]))))
        for low, high in parts(0, len(widths))
    ]
