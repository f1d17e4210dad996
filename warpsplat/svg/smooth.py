"""Smooth quadratics in the path commands that take the fewest characters (SVG 1.1, 8.3.7)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

from warpsplat.svg.commands import Pair, minus, row

SMALL = 300
"""Where coordinates of the view box reach further, absolute ones are hardly ever shorter than relative ones,
and not looked for."""


class Text(NamedTuple):
    """What is written so far."""

    length: int
    text: str


def shortest_smooth(joints: Sequence[Pair], control: Pair) -> str:
    """Path data of an outline through ``joints``; ``control``: that of its first quadratic, from which the
    others follow. Relative or absolute, as is shorter, by dynamic programming over the last letter.
    """
    start, end = joints[:2]
    head = f"M{row(start, False)}"
    ways = {"q": (*minus(control, start), *minus(end, start)), "Q": (*control, *end)}
    best = {letter: _longer(Text(0, ""), head + letter + row(way, False)) for letter, way in ways.items()}
    for before, after in itertools.pairwise(joints[1:]):
        found: dict[str, Text] = {}
        for way, numbers in (("t", minus(after, before)), ("T", after)):
            joined, fresh = row(numbers, True), way + row(numbers, False)
            found[way] = min(
                _longer(text, joined if way == letter else fresh) for letter, text in best.items()
            )
        best = found
    return min(best.values()).text


def _longer(text: Text, added: str) -> Text:
    return Text(text.length + len(added), text.text + added)
