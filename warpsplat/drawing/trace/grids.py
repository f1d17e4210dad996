"""Arrays of an image's pixels: their types, disjoint sets, connected components."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.portable import filters

Floats = npt.NDArray[np.floating[Any]]
Ints = npt.NDArray[np.integer[Any]]
Bools = npt.NDArray[np.bool_]

NO_REGION = -1
"""Label of a pixel that is in no region, and of everything outside the image."""

AROUND = 3  # [px] on each side of a crossing, within which labels are counted


class Box(NamedTuple):
    """A rectangle of pixels."""

    left: int
    top: int
    right: int
    """The column after the last one."""
    bottom: int

    def slices(self) -> tuple[slice, slice]:
        """Return what an array is indexed with to get these pixels."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def grown(self, by: int) -> Box:
        """Return it with so many pixels more on each side, of an image that begins at 0."""
        return Box(max(self.left - by, 0), max(self.top - by, 0), self.right + by, self.bottom + by)


def bounding_boxes(labels: Ints, count: int) -> list[Box]:
    """Return the box around the pixels of each label from 0 to ``count`` - 1; all are there.

    ``labels``: shape (height, width), negative outside.
    """
    sides = []
    for lines in (labels, labels.T):
        inside = lines >= 0
        owners, places = lines[inside], np.nonzero(inside)[0]
        low, high = np.zeros(count, np.intp), np.zeros(count, np.intp)
        # Of several values for one element the last one stays.
        low[owners[::-1]], high[owners] = places[::-1], places + 1
        sides += [low.tolist(), high.tolist()]
    top, bottom, left, right = sides
    return [Box(*box) for box in zip(left, top, right, bottom, strict=True)]


def channel_max(values: Floats) -> Floats:
    """Return the maximum over the last axis, ten times as fast as NumPy where that axis is short."""
    return functools.reduce(np.maximum, np.moveaxis(values, -1, 0))


def depth(mask: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Return the distance of each pixel from those outside the mask, or the image [px], (height, width)."""
    return filters.distance(np.pad(mask, 1))[1:-1, 1:-1]


def uneven_pixels(image: Floats, tolerance: float) -> Bools:
    """Return the pixels that differ from one beside them by more than a tolerance, shape (height, width).

    ``image``: shape (height, width, channel).
    """
    uneven = np.zeros(image.shape[:2], np.bool_)
    across, down = (channel_max(np.abs(np.diff(image, axis=axis))) > tolerance for axis in (1, 0))
    uneven[:, 1:] |= across
    uneven[:, :-1] |= across
    uneven[1:] |= down
    uneven[:-1] |= down
    return uneven


def dilated(mask: npt.NDArray[Any], side: int) -> Bools:
    """Return the pixels within a square of ``side`` px around those of a mask."""
    return np.asarray(cv2.dilate(np.asarray(mask, np.uint8), np.ones((side, side), np.uint8)) > 0)


def eroded(mask: npt.NDArray[Any], side: int) -> Bools:
    """Return the pixels of a mask around which all of a square of ``side`` px is in it, or off the image."""
    return np.asarray(cv2.erode(np.asarray(mask, np.uint8), np.ones((side, side), np.uint8)) > 0)


def at_pixels(values: npt.NDArray[Any], points: Floats) -> npt.NDArray[Any]:
    """Return the values of the pixels that points (point, 2) lie in, or of the nearest ones of the image."""
    height, width = values.shape[:2]
    columns, rows = points.astype(np.intp).T
    return values[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]


def border(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the values along the border of an image, those of corners twice."""
    return np.concatenate([values[0], values[-1], values[:, 0], values[:, -1]])


def joined(count: int, one: Ints, other: Ints) -> Ints:
    """Return the number of each item's set, where pairs are in one set each (union-find).

    Args:
        count: Of items.
        one: An item of each pair, shape (pair,).
        other: The other one, shape (pair,).

    Returns:
        Counted from 0 in the order of the first items, shape (count,).
    """
    parent = np.arange(count)
    while len(one):
        np.minimum.at(parent, np.maximum(one, other), np.minimum(one, other))
        while (parent != (above := parent[parent])).any():
            parent = above
        one, other = parent[one], parent[other]
        differ = one != other
        one, other = one[differ], other[differ]
    return np.asarray(np.unique(parent, return_inverse=True)[1], np.int32)


def linked_components(across: Bools, down: Bools, inside: Bools) -> tuple[int, Ints]:
    """Label the connected components of the pixels ``inside``.

    Args:
        across: Whether a pixel is linked to the one on its right, shape (height, width - 1).
        down: Whether it is linked to the one below, shape (height - 1, width).
        inside: Shape (height, width).

    Returns:
        Their number, and the label of each pixel, NO_REGION outside; shape (height, width).
    """
    height, width = inside.shape
    # Pixels with their links between them form an image whose components OpenCV finds.
    woven = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    woven[::2, ::2] = inside
    woven[::2, 1::2] = across & inside[:, 1:] & inside[:, :-1]
    woven[1::2, ::2] = down & inside[1:] & inside[:-1]
    count, parts = cv2.connectedComponents(woven, connectivity=4, ltype=cv2.CV_32S)
    return count - 1, np.asarray(parts[::2, ::2] - 1, np.int32)


def components(values: Ints) -> tuple[Ints, Ints]:
    """Label the connected components of equal ``values``, shape (height, width); return their values, too.

    Where two values cross as on a chessboard, ``prefers_main_diagonal`` decides which pair is connected.
    """
    everywhere = np.ones(values.shape, np.bool_)
    count, parts = linked_components(values[:, 1:] == values[:, :-1], values[1:] == values[:-1], everywhere)
    rows, columns = np.nonzero(crossings(values))
    around = np.pad(values, AROUND - 1, constant_values=NO_REGION)
    side = np.arange(2 * AROUND)
    down, right = rows[:, None, None] + side[:, None], columns[:, None, None] + side
    main = prefers_main_diagonal(around[down, right]).astype(np.intp)
    labels = joined(count, parts[rows, columns + 1 - main], parts[rows + 1, columns + main])[parts]
    of_each = np.zeros(int(labels.max()) + 1, np.int32)
    of_each[labels] = values
    return labels, of_each


def crossings(labels: Ints) -> Bools:
    """Find the corners where two labels meet as on a chessboard, shape (height - 1, width - 1)."""
    a, b, c, d = labels[:-1, :-1], labels[:-1, 1:], labels[1:, :-1], labels[1:, 1:]
    return np.asarray((a == d) & (b == c) & (a != b))


def prefers_main_diagonal(around: Ints) -> Bools:
    """Return whether upper left and lower right, not the other two, are the connected pixels of crossings.

    The pair whose label is rarer nearby is connected: it is a thin line.

    Args:
        around: The labels around each crossing, shape (crossing, 2 * AROUND, 2 * AROUND).
    """
    main, other = around[:, AROUND, AROUND], around[:, AROUND - 1, AROUND]
    counts = [(around == own[:, None, None]).sum(axis=(1, 2)) for own in (main, other)]
    return np.asarray(counts[0] <= counts[1])


def nearest_in(mask: Bools) -> Ints:
    """Return the flat index of the pixel of a mask that is nearest to each one, shape (height, width)."""
    _, labels = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    source = np.zeros(int(labels.max()) + 1, np.int64)
    source[labels[mask]] = np.flatnonzero(mask)
    return np.asarray(source[labels])


def nearest_of(mask: Bools, rows: Ints, columns: Ints) -> Ints:
    """Return the flat index of the pixel of a mask that is nearest to each of some pixels, shape (pixel,)."""
    if not len(rows):
        return np.zeros(0, np.int64)
    at = zip(np.nonzero(mask), (rows, columns), strict=True)
    (top, bottom), (left, right) = (
        (int(min(own.min(), asked.min())), int(max(own.max(), asked.max())) + 1) for own, asked in at
    )
    nearest = nearest_in(mask[top:bottom, left:right])[rows - top, columns - left]
    row, column = np.divmod(nearest, right - left)
    return np.asarray((row + top) * mask.shape[1] + column + left)


def unchecked() -> None:
    """Do nothing: the default for the check that long work makes so that it can be stopped."""
