"""Images as they were before they were enlarged by linear interpolation."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.drawing.trace.seeds import EDGE

LEAST, MOST = 1.1, 4.0
"""Factors of enlargement that are looked for."""

ROWS, LOOK = 4, 256
"""Rows by which the factor is found, and how many pixels of each."""

ROUNDING = 0.45
"""Root of the mean squared difference from an enlarged image, at the most [levels]: rounding leaves .3."""

MOST_FITTING = 3
"""Sizes that may explain the rows: of more, none is sure."""

FARTHEST = 2.0
"""How far a pixel of an enlarged image may be off [levels]: it was rounded along both sides."""


def before_enlarging(image: Floats) -> Floats | None:
    """Return the image from which one was made by linear interpolation; None: there is none.

    An enlarged image is the interpolation of a smaller one, but for rounding to whole levels. That is found
    by least squares along rows, then columns, whose equations are tridiagonal.

    Args:
        image: Levels, shape (height, width, channel).
    """
    height, width = image.shape[:2]
    sizes = np.arange(max(int(width / MOST), 2), int(width / LEAST))
    columns = _best(image, sizes)
    if columns is None:
        return None
    near = round(columns * height / width)
    rows = _best(image.swapaxes(0, 1), np.arange(max(near - 1, 2), min(near + 2, height)))
    if rows is None:
        return None
    small = _solved(_solved(image, columns).swapaxes(0, 1), rows).swapaxes(0, 1)
    again = _enlarged(_enlarged(small, width).swapaxes(0, 1), height).swapaxes(0, 1)
    if np.abs(again - image).max() > FARTHEST:  # a few edges may lie as those of another size do
        return None
    return np.ascontiguousarray(np.clip(np.round(small), 0, 255), np.float32)


def _best(image: Floats, sizes: Ints) -> int | None:
    """Return how many columns an image had before it was enlarged; None: it was none of ``sizes``."""
    width = image.shape[1]
    if not len(sizes):
        return None
    grey = image[..., :3].sum(axis=2)
    rows = _independent_rows(grey / 3)
    if rows is None:
        return None
    counts = np.append(0, np.cumsum(np.abs(np.diff(grey[rows], axis=1)).sum(axis=0)))
    side = min(LOOK, width)
    first = int((counts[side - 1 :] - counts[: len(counts) - side + 1]).argmax())
    values = grey[rows, first : first + side].T.astype(np.float64) / 3
    # All sizes at once, shape (size, column): each column lies between two unknown ones.
    place = (first + np.arange(side) + 0.5) * (sizes[:, None] / width) - 0.5
    place = np.clip(place, 0, sizes[:, None] - 1)
    low = np.minimum(place.astype(np.intp), sizes[:, None] - 2)
    share, low = place - low, low - low[:, :1]
    count = int(low.max()) + 2
    at = np.arange(len(sizes))[:, None] * count + low
    total = len(sizes) * count

    def summed(weights: Floats, where: Ints) -> Floats:
        sums = np.bincount(where.reshape(-1), weights.reshape(-1), total)
        return np.asarray(sums, np.float64).reshape(len(sizes), count)

    rest = 1 - share
    diagonal = summed(rest * rest, at) + summed(share * share, at + 1)
    beside = summed(rest * share, at)
    right = np.stack([summed(rest * row, at) + summed(share * row, at + 1) for row in values.T], axis=2)
    _tridiagonal(np.where(diagonal > 0, diagonal, 1).T, beside.T, right.swapaxes(0, 1))
    known = right.reshape(total, -1)
    off = rest[..., None] * known[at] + share[..., None] * known[at + 1] - values
    errors = np.square(off).sum(axis=(1, 2)) / (values.shape[1] * (side - low[:, -1] - 2))
    fitting = np.flatnonzero(errors < ROUNDING * ROUNDING)
    # Edges along the axes, and what is smooth, are as of any size.
    if not 0 < len(fitting) <= MOST_FITTING:
        return None
    return int(sizes[errors.argmin()])


def _independent_rows(image: Floats) -> list[int] | None:
    """Return the rows whose bends tell most beside one another; None: all are mixtures of fewer.

    Edges along the axes are alike in many rows, and lie as those of nearly any smaller image do.
    """
    bends, rows = np.diff(image, n=2, axis=1).astype(np.float64), list[int]()
    for _ in range(ROWS):
        sizes = np.square(bends).sum(axis=1)
        rows.append(int(sizes.argmax()))
        if sizes[rows[-1]] < EDGE * EDGE:
            return None
        own = bends[rows[-1]].copy()
        bends -= (bends * own).sum(axis=1)[:, None] / sizes[rows[-1]] * own
    return rows


def _tridiagonal(diagonal: Floats, beside: Floats, right: Floats) -> None:
    """Solve tridiagonal equations in place, shape (unknown, system) each, ``right`` with an axis more."""
    for i in range(1, len(diagonal)):
        share = beside[i - 1] / diagonal[i - 1]
        diagonal[i] -= share * beside[i - 1]
        right[i] -= share[:, None] * right[i - 1]
    right[-1] /= diagonal[-1][:, None]
    for i in range(len(diagonal) - 2, -1, -1):
        right[i] = (right[i] - beside[i][:, None] * right[i + 1]) / diagonal[i][:, None]


def _places(columns: int, size: int) -> tuple[Ints, Floats]:
    """Return between which of ``size`` columns each of more lies: the first, and the share of the second."""
    place = np.clip((np.arange(columns) + 0.5) * size / columns - 0.5, 0, size - 1)
    low = np.minimum(place.astype(np.intp), size - 2)
    return low, place - low


def _enlarged(image: Floats, columns: int) -> Floats:
    """Return an image interpolated to so many columns."""
    low, share = _places(columns, image.shape[1])
    return image[:, low] * (1 - share)[:, None] + image[:, low + 1] * share[:, None]


def _solved(image: Floats, size: int) -> Floats:
    """Return the image of ``size`` columns of which another one is the interpolation, by least squares."""
    columns = image.shape[1]
    low, weights = _places(columns, size)
    share = weights[:, None]
    values = np.moveaxis(image, 1, 0).reshape(columns, -1).astype(np.float64)
    rest = 1 - share
    squares = np.square(1 - weights), np.square(weights)
    diagonal = np.asarray(
        np.bincount(low, squares[0], size) + np.bincount(low + 1, squares[1], size), np.float64
    )
    beside = np.asarray(np.bincount(low, weights * (1 - weights), size), np.float64)
    right = np.zeros((size, values.shape[1]))
    np.add.at(right, low, rest * values)
    np.add.at(right, low + 1, share * values)
    _tridiagonal(diagonal[:, None], beside[:, None], right[:, None])
    return np.moveaxis(right.reshape(size, image.shape[0], image.shape[2]), 0, 1)
