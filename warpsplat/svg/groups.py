"""Paths in groups that share attributes, where that takes fewer characters, and identifiers by colour."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from PIL import ImageColor

from warpsplat.scene import Paint, Scene

GRADIENT = "gradient"
"""Identifier of paths that have no single colour."""

GROUP = "-group"
"""Suffix of the identifier of a group of shapes of one colour."""

LEVEL_ID = "level-"
"""Prefix of the identifier of a layer's group; the number of shapes up to its end follows."""

PAINT = 1
"""Index of the paint in ``PathElement.shared``."""


class Names:
    """Unique identifiers: from the second use on a name has a number."""

    def __init__(self) -> None:
        self._seen: Counter[str] = Counter()

    def next(self, name: str) -> str:
        """Return ``name``, with a number if it is taken."""
        self._seen[name] += 1
        return name if self._seen[name] == 1 else f"{name}-{self._seen[name]}"


def color_names(scene: Scene) -> list[str]:
    """Return a name for each shape's paint: that of the CSS colour nearest in sRGB, or ``GRADIENT``."""
    known = list(ImageColor.colormap)
    table = np.array([ImageColor.getrgb(name) for name in known]) / 255
    nearest = ((scene.colors[:, None] - table) ** 2).sum(axis=2).argmin(axis=1).tolist()
    is_flat = (scene.paint == Paint.FLAT).tolist()
    return [known[i] if flat else GRADIENT for i, flat in zip(nearest, is_flat, strict=True)]


@dataclass(frozen=True)
class PathElement:
    """A path before it is written. Attributes are texts that begin with a space, or empty."""

    data: str
    shared: tuple[str, ...]
    """Attributes that neighbours may have in common, the outermost group's first: opacity, paint, line."""
    own: str = ""
    element: str = ""
    """A circle, ellipse or rectangle that is the same, with its geometry; empty: a path."""

    def __str__(self) -> str:
        outermost, *inner = self.shared
        element = self.element or f'path d="{self.data}"'
        return f"<{element}{''.join(inner)}{self.own}{outermost}/>"

    def without(self, attributes: Sequence[object]) -> PathElement:
        """Return the path without the shared attributes for which ``attributes`` has a true value."""
        pairs = zip(attributes, self.shared, strict=True)
        return replace(self, shared=tuple("" if left_out else text for left_out, text in pairs))


def painted(paths: Sequence[PathElement], colors: Sequence[str], names: Names) -> list[str]:
    """Return the elements of ``paths``, neighbours of one paint in groups named after it.

    ``colors``: the name of each path's paint. ``names``: identifiers of groups so far.
    """
    elements = []
    for paint, run in itertools.groupby(zip(paths, colors, strict=True), lambda one: one[0].shared[PAINT]):
        alike = list(run)
        if len(alike) == 1:
            elements.append(str(alike[0][0]))
            continue
        inner = [path.without([i == PAINT for i in range(len(path.shared))]) for path, _ in alike]
        elements += [f'<g id="{names.next(alike[0][1] + GROUP)}"{paint}>', *nested(inner), "</g>"]
    return elements


def nested(paths: Sequence[PathElement], level: int = 0) -> list[str]:
    """Return the elements of ``paths``, those with equal attributes in groups where that is shorter.

    Greedy: neighbours with the same attribute of ``level`` share a group with all attributes that they have
    in common; if that is no shorter, they are grouped by the next attribute.
    """
    if not paths or level == len(paths[0].shared):
        return [str(path) for path in paths]
    elements = []
    for attribute, run in itertools.groupby(paths, lambda path: path.shared[level]):
        alike = list(run)
        columns = list(zip(*(path.shared for path in alike), strict=True))
        common = [column[0] if len(set(column)) == 1 else "" for column in columns]
        attributes = "".join(common)
        if attribute and (len(alike) - 1) * len(attributes) > len("<g></g>"):
            inner = [path.without(common) for path in alike]
            elements += [f"<g{attributes}>", *nested(inner, level + 1), "</g>"]
        else:
            elements += nested(alike, level + 1)
    return elements
