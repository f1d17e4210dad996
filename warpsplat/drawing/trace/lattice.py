"""The lattice of scaled pixel art and QR codes, found by its period; colours of cells by their pixels."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.portable import elementary

SAMPLES = 1024
"""Most rows and columns [px], from the middle of an image, that a period is looked for in."""

TURN = 4096
"""Steps of a turn, a power of two: periods are sought among ``TURN`` / whole numbers."""

AMPLITUDE = 1 << 14
"""Amplitude of the sine table, in whole numbers: their sums do not depend on the processor."""

PERIODS = (1.4, 64.0)
"""Shortest and longest period [px]."""

COHERENCE = 0.7
"""Least share of the edges, as a vector sum, that a lattice must explain."""

NEARLY = 0.9
"""Coherence of a longer period, over the largest one, that is preferred to a fraction of it."""

FEWEST_EDGES = 8.0
"""Fewest lines with edges, counted by their weights, for a lattice: few are in step by chance."""

EXPLAINED, EXPLAINED_SOFT, EXPLAINED_TONES = 0.93, 0.98, 0.8
"""Least share of an image's variance that its cells must explain; of a smooth one any would explain much.
Blur takes the corners off cells of two tones."""

STRAY, MOST_STRAY = 96, 0.001
"""[levels] that few pixels in the middles of cells may be off; largest share of them. Blur and noise spare
most middles, round corners of a drawing on a grid do not."""

LEAST_EDGES = 0.02
"""Least share of the pixels at which dark and light ones meet, along each axis, for cells of two tones."""

SHARPENINGS = 4
"""Times that interpolated colours are compared with the image, and corrected."""

NOISES = 5.0
"""Largest difference of a cell from its colour, over the median of the pixels' errors."""

LEAST_NOISE = 3.0
"""[levels] that the colours of equal cells may differ by in any image."""

RARE, STRAYED = 0.02, 3.0
"""A colour of fewer cells than this share is one of the others with more noise, if it is so many times the
largest difference from it."""

MOST_COLORS = 64
"""Most colours of pixel art."""

OUTLIERS = 0.01
"""Share of the cells that are in none of the colours, and are given the nearest."""

SNAP = 0.15
"""Share of a cell that the lines at the borders of an image may be off for it to consist of whole cells."""

ALIKE = 0.9
"""Least ratio of the shorter side of a cell to the longer."""

CELLS = (8, 256)
"""Fewest and most cells on a side."""


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


class Lattice(NamedTuple):
    """An image as cells."""

    columns: Axis
    rows: Axis
    colors: Ints
    """Number of each cell's colour, shape (row, column)."""
    palette: Ints
    """Levels in 0..255, shape (color, channel)."""


def find_lattice(levels: Ints) -> Lattice | None:
    """Return the cells that make up an image, with noise or soft borders; None if it is not made of cells.

    ``levels``: 0..255, shape (height, width, channel).
    """
    for soft in (False, True):
        axes = _find_axes(levels, soft=soft)
        found = _with_colors(levels, axes, soft, EXPLAINED_SOFT if soft else EXPLAINED) if axes else None
        if found:
            return found
    return _two_tones(levels)


def _find_axes(levels: Ints, *, soft: bool) -> tuple[Axis, Axis] | None:
    """Return the lines between columns and between rows of cells that are nearly square."""
    columns = find_axis(levels, 1, soft=soft)
    rows = find_axis(levels, 0, soft=soft) if columns else None
    is_square = columns and rows and ALIKE * columns.period < rows.period < columns.period / ALIKE
    return (columns, rows) if columns and rows and is_square else None


def _two_tones(levels: Ints) -> Lattice | None:
    """Return the dark and light cells of an image; None if it is not made of such. They may be blurred."""
    tone = levels[..., :3].astype(np.int32).sum(axis=2)
    dark = (2 * tone < tone.min() + tone.max()).astype(np.uint8)
    if min(np.count_nonzero(np.diff(dark, axis=axis)) for axis in (0, 1)) < LEAST_EDGES * dark.size:
        return None
    two = 255 * dark[..., None].astype(np.int64)
    axes = _find_axes(two, soft=False)
    found = _with_colors(two, axes, False, EXPLAINED_TONES) if axes else None
    if found is None or len(found.palette) != 2:
        return None
    inside = np.ix_(_middles(found.rows.borders(len(dark))), _middles(found.columns.borders(dark.shape[1])))
    colors = [np.median(levels[inside][found.colors == number], axis=0) for number in (0, 1)]
    return found._replace(palette=np.round(colors).astype(np.int64))


def _middles(borders: Floats) -> Ints:
    """Return the pixel in the middle of each cell, shape (cell,)."""
    return np.minimum((borders[:-1] + borders[1:]) / 2, borders[-1] - 1).astype(np.intp)


def find_axis(levels: Ints, axis: int, *, soft: bool = False) -> Axis | None:
    """Return the lines that the cells of an image end at; None if its edges are not on such lines.

    Args:
        levels: 0..255, shape (height, width, channel).
        axis: 0 for lines between rows, 1 between columns.
        soft: whether colours are interpolated between the centres of cells, where slopes change.
    """
    size = levels.shape[axis]
    longest = min(PERIODS[1], size / CELLS[0])
    if longest < PERIODS[0]:
        return None
    first = max(0, size - SAMPLES) // 2
    # Noise and shading are everywhere, edges on few lines.
    steps = _steps(np.moveaxis(levels, axis, 0)[first : first + SAMPLES], soft=soft)
    edges = np.maximum(steps - np.sort(steps)[len(steps) // 2], 0)
    total = int(edges.sum())
    if not total or total**2 < FEWEST_EDGES * float(np.square(edges.astype(np.float64)).sum()):
        return None
    turns = np.arange(int(np.ceil(TURN / longest)), int(TURN / PERIODS[0]) + 1, 1 + (size > SAMPLES // 2))
    lines = np.arange(len(edges)) + first + 1
    some = edges > 0
    places, weights = turns[:, None] * lines[some] & (TURN - 1), edges[some].astype(np.float64)
    waves = np.stack([wave.take(places) @ weights for wave in _turn()])
    coherence = np.sqrt(np.square(waves).sum(axis=0)) / (AMPLITUDE * total)
    if coherence.max() < COHERENCE:
        return None
    # The longest of the periods that are about as good: the others are fractions of it.
    best = int(np.argmax(coherence >= max(COHERENCE, NEARLY * coherence.max())))
    while best + 1 < len(coherence) and coherence[best + 1] >= coherence[best]:
        best += 1
    found = _refined(lines, edges, waves[:, best], TURN / float(turns[best]))
    if soft:
        # Second differences are counted half a line late, and the lines are those through the centres.
        found = Axis(found.origin + 0.5 + found.period / 2, found.period)
    return _snapped(found, size)


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


@functools.cache
def _turn() -> Floats:
    """Return cosine and sine over a turn in whole numbers, shape (2, TURN)."""
    angles = np.arange(TURN) * (2 * np.pi / TURN)
    return np.round(AMPLITUDE * np.stack([elementary.cos(angles), elementary.sin(angles)]))


def _steps(lines: Ints, *, soft: bool) -> Ints:
    """Return the total of the differences between neighbouring lines; if ``soft``, of their changes."""
    return np.abs(np.diff(lines.astype(np.int16), n=1 + soft, axis=0)).sum(axis=(1, 2), dtype=np.int64)


def _with_colors(levels: Ints, axes: tuple[Axis, Axis], soft: bool, least: float) -> Lattice | None:
    """Return the cells with their colours; None if there are too few or too many, or they are not even.

    ``least``: share of the variance that they must explain.
    """
    columns, rows = axes
    height, width = levels.shape[:2]
    down, across = rows.borders(height), columns.borders(width)
    if not all(CELLS[0] <= len(borders) - 1 <= CELLS[1] for borders in (down, across)):
        return None
    inside = np.ix_(_inner(down).reshape(-1), _inner(across).reshape(-1))
    shape = len(down) - 1, -1, len(across) - 1, len(inside[1][0]) // (len(across) - 1), levels.shape[2]

    def at_centers(image: npt.NDArray[Any]) -> Floats:
        return np.median(image[inside].reshape(shape), axis=(1, 3))

    def shown(colors: Floats) -> Floats:
        return _sampled(_sampled(colors, down, height, 0, soft=soft), across, width, 1, soft=soft)

    colors = seen = at_centers(levels)
    for _ in range(SHARPENINGS if soft else 0):
        colors = np.clip(colors + seen - at_centers(shown(colors)), 0, 255)
    error, variance = np.square(levels - shown(colors)), np.square(levels - levels.mean(axis=(0, 1)))
    if not soft:
        mixed = _averaged(_averaged(colors, down, height, 0), across, width, 1)
        error = min(error, np.square(levels - mixed), key=np.sum)
    if error.sum() > (1 - least) * variance.sum():
        return None
    strays = np.abs(levels[inside].reshape(shape) - colors[:, None, :, None]).max(axis=4) > STRAY
    if strays.mean() > MOST_STRAY:
        return None
    found = _numbered(colors, NOISES * float(np.sqrt(np.median(error))))
    return Lattice(columns, rows, *found) if found else None


def _numbered(colors: Floats, noise: float) -> tuple[Ints, Ints] | None:
    """Return the number of each cell's colour, and the colours; None if there are more than ``MOST_COLORS``.

    ``noise``: largest difference of a cell from its colour [levels].
    """
    rest = colors.reshape(-1, colors.shape[2])
    palette: list[Floats] = []
    reach = max(noise, LEAST_NOISE)
    while len(rest) > OUTLIERS * colors.shape[0] * colors.shape[1]:
        if len(palette) == MOST_COLORS:
            return None
        _, which, counts = np.unique(np.round(rest / reach), axis=0, return_inverse=True, return_counts=True)
        center = np.median(rest[which.reshape(-1) == counts.argmax()], axis=0)
        near = np.abs(rest - center).max(axis=1) <= reach
        palette.append(np.median(rest[near], axis=0))
        rest = rest[np.abs(rest - palette[-1]).max(axis=1) > reach]
    known = np.round(palette)
    which = np.abs(colors[:, :, None] - known).max(axis=3).argmin(axis=2)
    # Cells beside strong edges have more noise than others.
    counts = np.bincount(which.reshape(-1), minlength=len(known))
    order = np.argsort(-counts, kind="stable")
    kept: list[int] = []
    for i in order.tolist():
        near = kept and np.abs(known[kept] - known[i]).max(axis=1).min() <= STRAYED * reach
        if not near or counts[i] > RARE * which.size:
            kept.append(i)
    known = known[kept]
    return np.abs(colors[:, :, None] - known).max(axis=3).argmin(axis=2), known.astype(np.int64)


def _inner(borders: Floats) -> Ints:
    """Return the pixels in the middle half of each cell, the same number of each, shape (cell, pixel)."""
    count = max(1, int(np.median(np.diff(borders)) / 2))
    first = np.round((borders[:-1] + borders[1:] - count) / 2).astype(np.int64)
    return np.clip(first[:, None] + np.arange(count), 0, int(borders[-1]) - 1)


def _sampled(colors: Floats, borders: Floats, size: int, axis: int, *, soft: bool) -> Floats:
    """Return the colours of pixels along one axis: of their cells, or interpolated between the centres."""
    places = np.arange(size) + 0.5
    if not soft:
        return np.take(colors, np.searchsorted(borders, places, side="right") - 1, axis=axis)
    centers = (borders[:-1] + borders[1:]) / 2
    before = np.clip(np.searchsorted(centers, places) - 1, 0, len(centers) - 2)
    share = np.clip((places - centers[before]) / (centers[before + 1] - centers[before]), 0, 1)
    share = share.reshape([-1, 1, 1] if axis == 0 else [1, -1, 1])
    return (1 - share) * np.take(colors, before, axis=axis) + share * np.take(colors, before + 1, axis=axis)


def _averaged(colors: Floats, borders: Floats, size: int, axis: int) -> Floats:
    """Return the mean colours of pixels along one axis, as antialiased where cells end within."""
    shape = [-1, 1, 1] if axis == 0 else [1, -1, 1]
    places = np.arange(size + 1)
    cells = np.minimum(np.searchsorted(borders, places, side="right") - 1, len(borders) - 2)
    whole = colors * np.diff(borders).reshape(shape)
    until = np.take(np.cumsum(whole, axis=axis) - whole, cells, axis=axis)
    return np.diff(
        until + (places - borders[cells]).reshape(shape) * np.take(colors, cells, axis=axis), axis=axis
    )
