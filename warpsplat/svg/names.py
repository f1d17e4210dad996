"""Identifiers for paths, by their colours: what an editor's list of objects shows."""

from __future__ import annotations

from collections import Counter

import numpy as np
from PIL import ImageColor

from warpsplat.scene import FloatArray, Paint, Scene

GRADIENT = "gradient"
"""What a path is called that has no one colour."""

LEVEL_ID = "level-"
"""What the name of a layer's group begins with; the number of shapes up to its end follows."""


def path_names(scene: Scene) -> list[str]:
    """A name for each shape: that of the CSS colour nearest to its own, and a number where others have it."""
    seen: Counter[str] = Counter()
    names = []
    for color, paint in zip(_nearest(scene.colors), scene.paint.tolist(), strict=True):
        name = color if paint == Paint.FLAT else GRADIENT
        seen[name] += 1
        names.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return names


def _nearest(colors: FloatArray) -> list[str]:
    """Names of the CSS colours nearest in sRGB to ``colors``, shape (n, 3)."""
    known = list(ImageColor.colormap)
    table = np.array([ImageColor.getrgb(name) for name in known]) / 255
    apart = ((colors[:, None] - table) ** 2).sum(axis=2)
    return [known[i] for i in apart.argmin(axis=1).tolist()]
