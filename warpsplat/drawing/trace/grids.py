"""Arrays of an image's pixels: types, connected parts, union of sets."""

from __future__ import annotations

import functools
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]
Ints = npt.NDArray[np.integer[Any]]
Bools = npt.NDArray[np.bool_]

NOBODY = -1
"""Label of a pixel that no region has."""


def largest(values: Floats) -> Floats:
    """Over the last axis, the few channels of pixels: NumPy's own maximum takes ten times as long."""
    return functools.reduce(np.maximum, np.moveaxis(values, -1, 0))


def linked_parts(across: Bools, down: Bools, inside: Bools) -> tuple[int, Ints]:
    """Connected parts of the pixels ``inside``.

    Args:
        across: whether a pixel is linked to the one on its right, shape (height, width - 1).
        down: to the one below, shape (height - 1, width).
        inside: shape (height, width).

    Returns:
        How many, and each pixel's, NOBODY outside; shape (height, width).
    """
    height, width = inside.shape
    # Pixels with their links between them: an image whose parts OpenCV finds.
    woven = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    woven[::2, ::2] = inside
    woven[::2, 1::2] = across & inside[:, 1:] & inside[:, :-1]
    woven[1::2, ::2] = down & inside[1:] & inside[:-1]
    count, parts = cv2.connectedComponents(woven, connectivity=4, ltype=cv2.CV_32S)
    return count - 1, np.asarray(parts[::2, ::2] - 1, np.int32)


class Sets:
    """Disjoint sets of 0 .. count - 1 (union-find)."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))

    def find(self, item: int) -> int:
        """The representative of the set that ``item`` is in."""
        parent = self._parent
        while parent[item] != item:
            parent[item] = parent[parent[item]]
            item = parent[item]
        return item

    def join(self, a: int, b: int) -> None:
        """Make one set of two."""
        a, b = self.find(a), self.find(b)
        self._parent[max(a, b)] = min(a, b)

    def numbers(self) -> Ints:
        """The set of each item, counted from 0 in the order of their first items."""
        roots = [self.find(item) for item in range(len(self._parent))]
        return np.asarray(np.unique(roots, return_inverse=True)[1], np.int32)
