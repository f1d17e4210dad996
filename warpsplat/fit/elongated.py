"""Elongated components of the error, which a stroke covers better than a fill."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.portable import elementary
from warpsplat.scene import FloatArray, IndexArray

MIN_ASPECT = 8.0
"""Length over width of a component that gets a stroke: on shorter ones fills are as good
(docs/experiments.md)."""

MIN_STROKE_SHARE = 0.8
"""Minimum share of the component that a stroke has to cover ..."""

MIN_ADVANTAGE = 2.0
"""... and minimum ratio of that share to the one that a fill covers."""


@dataclass(frozen=True)
class ComponentBars:
    """For each component, the straight bar with its area and second moments."""

    centres: FloatArray
    """[px], shape (component, 2)."""
    angles: FloatArray
    """[rad]"""
    lengths: FloatArray
    """[px]"""
    widths: FloatArray
    """[px]"""
    shares: FloatArray
    """Share of the component that the bar covers, estimated by how much the component spreads sideways."""

    @staticmethod
    def of(row: IndexArray, column: IndexArray, label: npt.NDArray[Any], number: int) -> ComponentBars:
        """Return the bars of the pixels labelled 1 to ``number`` - 1."""
        size = np.bincount(label, minlength=number)[1:]

        def mean(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return np.asarray(np.bincount(label, weights=values, minlength=number)[1:] / size)

        x, y = column + 0.5, row + 0.5
        cx, cy = mean(x), mean(y)
        # A pixel is a square, whose own second moment is a twelfth.
        xx, yy = mean(x * x) - cx**2 + 1 / 12, mean(y * y) - cy**2 + 1 / 12
        xy = mean(x * y) - cx * cy
        half, root = (xx + yy) / 2, elementary.hypot((xx - yy) / 2, xy)
        length, breadth = np.sqrt(12 * (half + root)), np.sqrt(12 * np.maximum(half - root, 1e-6))
        width = size / length
        angle, share = 0.5 * elementary.arctan2(2 * xy, xx - yy), np.minimum(1.0, width / breadth)
        arrays = (np.stack([cx, cy], axis=1), angle, length, width, share)
        return ComponentBars(*(np.asarray(array, np.float32) for array in arrays))

    def exceed(self, fill_shares: FloatArray) -> npt.NDArray[np.bool_]:
        """Return where a stroke removes more error than a fill that covers ``fill_shares`` of a component."""
        share = np.maximum(MIN_STROKE_SHARE, MIN_ADVANTAGE * fill_shares)
        return np.asarray((self.lengths > MIN_ASPECT * self.widths) & (self.shares > share))
