"""The lattice of enlarged pixel art and QR codes, found by its period; colours of cells by their pixels."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.portable import elementary
from warpsplat.portable.sequences import interp

PART = 1024  # [px] most rows and columns, from the middle of an image, that are inspected
CELLS = (8, 256)  # fewest and most cells on a side
MOST_COLORS = 64  # of pixel art
TURN = 4096  # steps of a turn, a power of two: periods are sought among this over whole numbers
SHORTEST = 1.4  # [px] period
COHERENCE = 0.7  # least share of the edges, as a vector sum, that a lattice must explain
NEARLY = 0.9  # least ratio of what is about equal: coherences of multiples of a period, sides of a cell
SNAP = 0.15  # share of a cell that lines at the borders may be off for an image to consist of whole cells
FINE = 0.25  # [px] that the borders of cells are rounded to where they are no whole numbers of cells
NOISES = 2.0  # largest difference of a cell from its colour, over the RMS of the pixels' errors
SHARPENINGS = 4  # times that interpolated colours are compared with the image, and corrected
EXPLAINED = 0.9
"""Least share of an image's variance that its cells must explain: sprites and QR codes with noise, blur or
JPEG have 0.944 or more, what has other edges than those of cells 0.80 or less."""
STRAY = 0.001
"""Share of the cells that may be in none of the colours, and of the pixels in their middles that may be off
by half of the contrast: noise and blur spare them, round corners of drawings on a grid are 0.003 to 0.005."""


class Axis(NamedTuple):
    """Equally spaced lines across one axis of an image."""

    origin: float
    """Place of a line [px]."""
    period: float
    """[px]"""

    def borders(self, size: int) -> Floats:
        """Return 0, the lines between 0 and ``size``, and ``size`` [px]."""
        first = self.origin % self.period
        lines = first + self.period * np.arange(np.ceil((size - first) / self.period))
        # A cell of less than half a pixel at the border has no pixel of its own.
        inner = lines[(lines >= 0.5) & (lines <= size - 0.5)]
        return np.concatenate([[0.0], inner, [float(size)]])


@dataclass(frozen=True)
class Cells:
    """An image as cells of one colour each."""

    colors: Ints
    """Number of each cell's colour, shape (row, column)."""
    palette: Ints
    """Levels in 0..255, shape (color, channel)."""
    across: Floats | Ints
    """Borders of the columns [px], shape (column + 1,)."""
    down: Floats | Ints
    """Borders of the rows [px], shape (row + 1,)."""
    per_pixel: float
    """Units per pixel in which all borders are whole numbers."""


def find_lattice(levels: Ints) -> Cells | None:
    """Return the cells that make up an image, with noise or soft borders; None if it is not made of cells.

    ``levels``: 0..255, shape (height, width, channel).
    """
    tone = levels[..., :3].sum(axis=2, dtype=np.int16)
    is_light = 2 * tone >= tone.min() + tone.max()  # blurred cells of two tones have sharp edges so
    two = np.uint8(255) * is_light[..., None]
    for view, soft in ((levels, False), (levels, True), (two, False)):
        columns = find_axis(view, 1, soft=soft)
        rows = find_axis(view, 0, soft=soft) if columns else None
        if columns and rows and NEARLY * columns.period < rows.period < columns.period / NEARLY:
            found = _with_colors(levels, view, columns, rows, soft=soft)
            if found:
                return found
    return None


def find_axis(levels: Ints, axis: int, *, soft: bool = False) -> Axis | None:
    """Return the lines that the cells of an image end at; None if its edges are not on such lines.

    Args:
        levels: 0..255, shape (height, width, channel).
        axis: 0 for lines between rows, 1 between columns.
        soft: whether colours are interpolated between the centres of cells, where slopes change.
    """
    size = levels.shape[axis]
    longest = size / CELLS[0]
    if longest < SHORTEST:
        return None
    first = max(0, size - PART) // 2
    lines = np.moveaxis(levels, axis, 0)[first : first + PART].astype(np.int16)
    steps = np.abs(np.diff(lines, n=1 + soft, axis=0)).sum(axis=(1, 2), dtype=np.int64)
    # Noise and shading are everywhere, edges on few lines.
    edges = np.maximum(steps - np.sort(steps)[len(steps) // 2], 0)
    total = int(edges.sum())
    if not total:
        return None
    turns = np.arange(int(np.ceil(TURN / longest)), int(TURN / SHORTEST) + 1, 1 + (size > PART // 2))
    numbers = np.arange(len(edges)) + first + 1
    some = edges > 0
    places, weights = turns[:, None] * numbers[some] & (TURN - 1), edges[some].astype(np.float64)
    waves = np.stack([wave.take(places) @ weights for wave in _turn()])
    coherence = np.sqrt(np.square(waves).sum(axis=0)) / (TURN * total)
    if coherence.max() < COHERENCE:
        return None
    # The longest of the periods that are about as good: the others are fractions of it.
    best = int(np.argmax(coherence >= max(COHERENCE, NEARLY * coherence.max())))
    while best + 1 < len(coherence) and coherence[best + 1] >= coherence[best]:
        best += 1
    found = _refined(numbers, edges, waves[:, best], TURN / float(turns[best]))
    if soft:
        # Second differences are counted half a line late, and the lines are those through the centres.
        found = Axis(found.origin + 0.5 + found.period / 2, found.period)
    return _snapped(found, size)


@functools.cache
def _turn() -> Floats:
    """Return cosine and sine over a turn in whole numbers, whose sums are the same on every processor."""
    angles = np.arange(TURN) * (2 * np.pi / TURN)
    return np.round(TURN * np.stack([elementary.cos(angles), elementary.sin(angles)]))


def _refined(lines: Ints, weights: Ints, wave: Floats, period: float) -> Axis:
    """Return origin and period by least squares, each edge belonging to the nearest line."""
    cosine, sine = wave
    origin = float(elementary.arctan2(sine, cosine)) / (2 * np.pi) * period
    for _ in range(3):
        numbers = np.round((lines - origin) / period)
        near = np.abs(lines - origin - numbers * period) <= 0.35 * period
        share = weights * near / max(1, (weights * near).sum())
        across, along = (share * numbers).sum(), (share * lines).sum()
        spread = (share * np.square(numbers - across)).sum()
        if spread == 0:
            break
        period = float((share * (numbers - across) * (lines - along)).sum() / spread)
        origin = float(along - period * across)
    return Axis(origin, period)


def _snapped(axis: Axis, size: int) -> Axis:
    """Return an axis with whole numbers of cells in the image, or of pixels in a cell, if it has nearly."""
    count = round(size / axis.period)
    is_first = abs(axis.origin - axis.period * round(axis.origin / axis.period)) < SNAP * axis.period
    if is_first and abs(size / axis.period - count) < SNAP:
        return Axis(0.0, size / count)
    whole = round(axis.period)
    if abs(axis.period - whole) * size < axis.period / 2:
        return Axis(float(round(axis.origin)), float(whole))
    return axis


def _with_colors(levels: Ints, view: Ints, columns: Axis, rows: Axis, *, soft: bool) -> Cells | None:
    """Return the cells with their colours; None if these are too many, or do not explain the image.

    ``view``: the image, or its two tones, that tells which cells have the same colour.
    """
    height, width = levels.shape[:2]
    down, across = rows.borders(height), columns.borders(width)
    if not all(CELLS[0] <= len(borders) - 1 <= CELLS[1] for borders in (down, across)):
        return None
    inner, lines = _inner(down), _inner(across)
    inside = np.ix_(inner.reshape(-1), lines.reshape(-1))

    def at_centers(image: npt.NDArray[Any]) -> Floats:
        return np.median(image[inside].reshape(*inner.shape, *lines.shape, image.shape[2]), axis=(1, 3))

    def shown(colors: Floats, along: Callable[[Floats, Floats, int], Floats]) -> Floats:
        return along(along(colors, down, height).swapaxes(0, 1), across, width).swapaxes(0, 1)

    def error(colors: Floats) -> Floats:
        both = (np.square(levels - shown(colors, along)) for along in (_averaged, _interpolated))
        return min(both, key=np.sum)

    colors = seen = at_centers(view)
    for _ in range(SHARPENINGS if soft else 0):
        colors = np.clip(colors + seen - at_centers(shown(colors, _interpolated)), 0, 255)
    # Cells beside strong edges are off by as much as pixels are.
    noise = NOISES * float(np.sqrt(error(colors).mean())) if view is levels else 0.0
    found = _numbered(colors, 1 + noise)
    if found is None or len(found[1]) < 2:
        return None
    numbers, palette = found
    centers = at_centers(levels)
    if view is not levels:
        palette = np.stack([np.median(centers[numbers == i], axis=0) for i in range(len(palette))])
    cells = palette[numbers]
    variance = np.square(levels - levels.mean(axis=(0, 1))).sum()
    off = np.abs(view[inside].reshape(*inner.shape, *lines.shape, -1) - seen[:, None, :, None]).max(axis=4)
    is_stray = 2 * off > int(view.max()) - int(view.min())
    if error(cells).sum() > (1 - EXPLAINED) * variance or is_stray.mean() > STRAY:
        return None
    longer = abs(height / columns.period - height / rows.period)  # what the sides of cells add up to [cells]
    is_whole = columns.origin == rows.origin == 0 and longer < SNAP
    per_pixel = 1 / columns.period if is_whole else 1 / FINE
    if is_whole:
        down = np.round(down * per_pixel) / per_pixel
    return Cells(numbers, np.round(palette).astype(np.int64), across, down, per_pixel)


def _numbered(colors: Floats, reach: float) -> tuple[Ints, Floats] | None:
    """Return the number of each cell's colour, and the colours; None if there are more than ``MOST_COLORS``.

    ``reach``: largest difference of a cell from its colour [levels].
    """
    rest = colors.reshape(-1, colors.shape[2])
    palette: list[Floats] = []
    while len(rest) > STRAY * colors.shape[0] * colors.shape[1]:
        if len(palette) == MOST_COLORS:
            return None
        _, which, counts = np.unique(np.round(rest / reach), axis=0, return_inverse=True, return_counts=True)
        center = np.median(rest[which.reshape(-1) == counts.argmax()], axis=0)
        near = np.abs(rest - center).max(axis=1) <= reach
        palette.append(np.median(rest[near], axis=0))
        rest = rest[np.abs(rest - palette[-1]).max(axis=1) > reach]
    known = np.stack(palette)
    return np.abs(colors[:, :, None] - known).max(axis=3).argmin(axis=2), known


def _inner(borders: Floats) -> Ints:
    """Return the pixels in the middle half of each cell, the same number of each, shape (cell, pixel)."""
    count = max(1, int(np.median(np.diff(borders)) / 2))
    first = np.round((borders[:-1] + borders[1:] - count) / 2).astype(np.int64)
    return np.clip(first[:, None] + np.arange(count), 0, int(borders[-1]) - 1)


def _averaged(colors: Floats, borders: Floats, size: int) -> Floats:
    """Return the mean colours of rows of pixels: cells may end within one. ``colors``: shape (cell, ...)."""
    sums = np.cumsum((colors.T * np.diff(borders)).T, axis=0)
    until = np.concatenate([np.zeros_like(sums[:1]), sums])
    return np.diff(interp(np.arange(size + 1), borders, until), axis=0)


def _interpolated(colors: Floats, borders: Floats, size: int) -> Floats:
    """Return the colours of rows of pixels, interpolated between the centres of cells."""
    return interp(np.arange(size) + 0.5, (borders[:-1] + borders[1:]) / 2, colors)
