"""Match the shapes of successive scenes of a run, which move little in between.

Ten steps later 99 of 100 shapes are found again, and less than 1 in 1000 of those is another one (as the
run itself knows; ``kodim23.png``, 512 shapes).
"""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpsplat.scene import FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import bounds

COLOR_WEIGHT = 0.1
"""Weight of a difference in colour relative to one in position [sides of the canvas]."""

FARTHEST = 0.1
"""Maximum distance of matching shapes, in the same measure."""

AT_ONCE = 1 << 18
"""Pairs of shapes compared at a time, to bound memory."""


@dataclass(frozen=True)
class Lives:
    """Shapes of several scenes, matched."""

    numbers: list[IndexArray]
    """Identifier of each shape, by scene."""
    order: list[int]
    """All identifiers, in painter's order."""


def lives(scenes: Sequence[Scene]) -> Lives:
    """Match shapes through the scenes of a run, in order."""
    numbers = [np.arange(len(scenes[0]))]
    order, count = list(range(len(scenes[0]))), len(scenes[0])
    for before, after in itertools.pairwise(map(looks, scenes)):
        known = {row: old for old, row in pairs(before, after)}
        now, behind = np.zeros(len(after), np.intp), -1
        fresh: dict[int, list[int]] = {}
        for row in range(len(after)):
            if row in known:
                now[row] = behind = numbers[-1][known[row]]
            else:
                now[row] = count
                fresh.setdefault(behind, []).append(count)
                count += 1
        numbers.append(now)
        order = fresh.get(-1, []) + [n for old in order for n in (old, *fresh.get(old, ()))]
    return Lives(numbers, order)


def looks(scene: Scene) -> FloatArray:
    """Return the features to match by: position, size and colour, shape (shape, 8)."""
    canvas = scene.canvas
    boxes = bounds(scene) / max(canvas.width, canvas.height)
    paints = COLOR_WEIGHT * np.column_stack([scene.colors, scene.opacities])
    return np.column_stack([boxes, paints]).astype(np.float32)


def pairs(before: FloatArray, after: FloatArray) -> list[tuple[int, int]]:
    """Return the indices of shapes that are in the next scene, and their indices there; both ascend.

    Those that are the nearest to each other by their ``looks``, as many as keep their order: depth is kept by
    what lives on.
    """
    if not (len(before) and len(after)):
        return []
    there, back = nearest(before, after), nearest(after, before)
    rows = np.flatnonzero(back[there] == np.arange(len(before)))
    apart = np.linalg.norm(before[rows] - after[there[rows]], axis=1)
    near = [(row, int(there[row])) for row in rows[apart < FARTHEST].tolist()]
    return [near[i] for i in ascending([row for _, row in near])]


def nearest(rows: FloatArray, others: FloatArray) -> IndexArray:
    """Return the index of the nearest of ``others`` to each of ``rows``."""
    found = np.zeros(len(rows), np.intp)
    columns = np.ascontiguousarray(others.T)
    step = max(1, AT_ONCE // len(others))
    for first in range(0, len(rows), step):
        squares = np.zeros((len(rows[first : first + step]), len(others)), np.float32)
        for mine, theirs in zip(rows[first : first + step].T, columns, strict=True):
            away = mine[:, None] - theirs
            away *= away
            squares += away
        found[first : first + step] = squares.argmin(axis=1)
    return found


def ascending(values: Sequence[int]) -> list[int]:
    """Return the indices of a longest ascending subsequence of distinct ``values`` (patience sorting)."""
    lasts: list[int] = []
    piles: list[int] = []
    behind: list[int] = []
    for i, value in enumerate(values):
        pile = bisect_left(lasts, value)
        behind.append(piles[pile - 1] if pile else -1)
        lasts[pile : pile + 1] = [value]
        piles[pile : pile + 1] = [i]
    found, i = [], piles[-1] if piles else -1
    while i >= 0:
        found.append(i)
        i = behind[i]
    return found[::-1]
