"""Components of the error that are long and thin: where a stroke removes more than a fill does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.portable import elementary
from warpsplat.scene import FloatArray, IndexArray

ASPECT = 8.0
"""Length over width of a component from which on a stroke may stand for it: at shorter ones fills are as good
(docs/experiments.md)."""

FULL = 0.8
"""Share of the component that a stroke has to cover ..."""

ADVANTAGE = 2.0
"""... at the least, or this over the share that the inscribed circle covers."""


@dataclass(frozen=True)
class Streaks:
    """A straight bar for each component, of its area and second moments."""

    centres: FloatArray
    """[px], shape (component, 2)."""
    angles: FloatArray
    """[rad]"""
    lengths: FloatArray
    """[px]"""
    widths: FloatArray
    """[px]"""
    shares: FloatArray
    """Of the component that the bar covers, by how much wider it is than a bar of its area and length."""

    @staticmethod
    def of(row: IndexArray, column: IndexArray, label: npt.NDArray[Any], number: int) -> Streaks:
        """Of the pixels of components 1 to ``number`` - 1."""

        def mean(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return np.asarray(np.bincount(label, weights=values, minlength=number)[1:] / size)

        size = np.bincount(label, minlength=number)[1:]
        x, y = column + 0.5, row + 0.5
        cx, cy = mean(x), mean(y)
        # A pixel is a square, whose own second moment is a twelfth.
        xx, yy = mean(x * x) - cx**2 + 1 / 12, mean(y * y) - cy**2 + 1 / 12
        xy = mean(x * y) - cx * cy
        half, root = (xx + yy) / 2, elementary.hypot((xx - yy) / 2, xy)
        length, breadth = np.sqrt(12 * (half + root)), np.sqrt(12 * np.maximum(half - root, 1e-6))
        width = size / length
        return Streaks(
            _single(np.stack([cx, cy], axis=1)),
            _single(0.5 * elementary.arctan2(2 * xy, xx - yy)),
            _single(length),
            _single(width),
            _single(np.minimum(1.0, width / breadth)),
        )

    def stand_for(self, circle_shares: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether a stroke removes more than a fill that covers ``circle_shares`` of each component."""
        share = np.maximum(FULL, ADVANTAGE * circle_shares)
        return np.asarray((self.lengths > ASPECT * self.widths) & (self.shares > share))


def _single(values: npt.NDArray[Any]) -> FloatArray:
    return np.asarray(values, np.float32)
