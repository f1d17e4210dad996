"""Neighbours that say the same share a group that says it, where that takes fewer characters."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from warpsplat.svg.names import GROUP, Names


@dataclass(frozen=True)
class Path:
    """A path before it is written. Attributes are texts with a space in front, empty ones say nothing."""

    data: str
    shared: tuple[str, ...]
    """What neighbours may have in common, what groups outermost first: opacity, paint, line."""
    own: str = ""

    def __str__(self) -> str:
        outermost, *inner = self.shared
        return f'<path d="{self.data}"{"".join(inner)}{self.own}{outermost}/>'


PAINT = 1
"""Which of the attributes in common says the paint."""


def painted(paths: Sequence[Path], colors: Sequence[str], names: Names) -> list[str]:
    """The elements of ``paths``, neighbours of one paint in groups that say it and are named after it.

    Args:
        paths: in painter's order.
        colors: what the paint of each is called.
        names: of groups so far.
    """
    elements = []
    for paint, run in itertools.groupby(zip(paths, colors, strict=True), lambda one: one[0].shared[PAINT]):
        alike = list(run)
        if len(alike) == 1:
            elements.append(str(alike[0][0]))
            continue
        left = [replace(p, shared=(*p.shared[:PAINT], "", *p.shared[PAINT + 1 :])) for p, _ in alike]
        name = names.next(alike[0][1] + GROUP)
        elements += [f'<g id="{name}"{paint}>', *nested(left), "</g>"]
    return elements


def nested(paths: Sequence[Path], level: int = 0) -> list[str]:
    """The elements of ``paths``, those of equal attributes in groups where it is shorter.

    Greedy: neighbours that agree in the attribute of ``level`` share a group, which says all that they agree
    in; if that is no shorter they are looked at by the next attribute.
    """
    if not paths or level == len(paths[0].shared):
        return [str(path) for path in paths]
    elements = []
    for said, run in itertools.groupby(paths, lambda path: path.shared[level]):
        alike = list(run)
        columns = list(zip(*(path.shared for path in alike), strict=True))
        common = [column[0] if len(set(column)) == 1 else "" for column in columns]
        attributes = "".join(common)
        group = f"<g{attributes}>", "</g>"
        if said and (len(alike) - 1) * len(attributes) > len("<g></g>"):
            left = [
                replace(path, shared=tuple("" if c else s for c, s in zip(common, path.shared, strict=True)))
                for path in alike
            ]
            elements += [group[0], *nested(left, level + 1), group[1]]
        else:
            elements += nested(alike, level + 1)
    return elements
