"""Identifiers by colours for paths and groups: what an editor's list of objects shows."""

from __future__ import annotations

from collections import Counter

import numpy as np
from PIL import ImageColor

from warpsplat.scene import FloatArray, Paint, Scene

GRADIENT = "gradient"
"""What a path is called that has no one colour."""

GROUP = "-group"
"""What the name of a group of shapes of one colour ends with, its number aside."""

LEVEL_ID = "level-"
"""What the name of a layer's group begins with; the number of shapes up to its end follows."""


class Names:
    """Identifiers that are each used once: from the second use on a name has a number."""

    def __init__(self) -> None:
        self._seen: Counter[str] = Counter()

    def next(self, name: str) -> str:
        """``name``, or with its number."""
        self._seen[name] += 1
        return name if self._seen[name] == 1 else f"{name}-{self._seen[name]}"


def color_names(scene: Scene) -> list[str]:
    """What each shape's colour is called: as the CSS colour nearest to it."""
    paints = zip(_nearest(scene.colors), scene.paint.tolist(), strict=True)
    return [color if paint == Paint.FLAT else GRADIENT for color, paint in paints]


def _nearest(colors: FloatArray) -> list[str]:
    """Names of the CSS colours nearest in sRGB to ``colors``, shape (n, 3)."""
    known = list(ImageColor.colormap)
    table = np.array([ImageColor.getrgb(name) for name in known]) / 255
    apart = ((colors[:, None] - table) ** 2).sum(axis=2)
    return [known[i] for i in apart.argmin(axis=1).tolist()]
