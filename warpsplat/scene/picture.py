"""What a file keeps as it is, between the shapes below and above it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Picture:
    """Markup that no shape can hold, and what a viewer shows of it."""

    markup: str
    """Elements of SVG."""
    size: tuple[float, float]
    """Of the canvas, in the markup's units."""
    corner: tuple[int, int]
    """Of the pixels: row and column on the canvas."""
    pixels: npt.NDArray[np.float32]
    """Premultiplied sRGB and opacity, shape (height, width, 4); empty where nothing is seen."""
