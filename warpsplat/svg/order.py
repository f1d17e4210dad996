"""Painting orders that look the same and bring similar shapes together.

Shapes that do not overlap may change places: those of one opacity, so that a group states it once, or those
of one colour, so that they can be edited as one.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from warpsplat.scene import Bools, FloatArray, IndexArray, Kind, Scene
from warpsplat.scene.geometry import bounds
from warpsplat.scene.scene import level_ends

BLOCK = 1024
"""Shapes that are ordered together: the time grows with the square."""

MARGIN = 1.0
"""Shapes closer to each other than this [px] count as overlapping: edges are soft."""


def by_opacity(scene: Scene) -> IndexArray:
    """Return an order of the shapes with long runs of equal kind and opacity, shape (shape,).

    Overlapping shapes keep their order, and all shapes their layers. Greedy: of the shapes with nothing
    unpainted below, those of the kind and opacity with the longest run come next.
    """
    return _by(scene, list(zip(scene.kind.tolist(), scene.opacities.tolist(), strict=True)))


def by_color(scene: Scene) -> IndexArray:
    """Return an order with long runs of equal kind, paint and colour in 8 bits, as ``by_opacity``."""
    levels = (np.round(255 * scene.colors).astype(np.int64) * [1 << 16, 1 << 8, 1]).sum(axis=1)
    kinds = scene.kind.astype(np.int64) + len(Kind) * scene.paint
    return _by(scene, list(zip(kinds.tolist(), levels.astype(np.float64).tolist(), strict=True)))


def _by(scene: Scene, keys: Sequence[tuple[int, float]]) -> IndexArray:
    """Return an order with long runs of equal keys."""
    boxes = bounds(scene)
    order: list[int] = []
    for start, end in itertools.pairwise((0, *level_ends(scene), len(scene))):
        for first in range(start, end, BLOCK):
            block = slice(first, min(first + BLOCK, end))
            order += [first + i for i in _arrange(boxes[block], keys[block])]
    return np.asarray(order, np.intp)


def _arrange(boxes: FloatArray, keys: Sequence[tuple[int, float]]) -> list[int]:
    """Return the order of shapes with these boxes and keys."""
    low, high = boxes[:, :2] - MARGIN / 2, boxes[:, 2:] + MARGIN / 2
    overlap: Bools = np.all((low[:, None] < high[None]) & (low[None] < high[:, None]), axis=2)
    above = [(np.flatnonzero(overlap[i, i + 1 :]) + i + 1).tolist() for i in range(len(keys))]
    below = np.triu(overlap, 1).sum(axis=0).tolist()
    """Number of unpainted shapes under each."""

    def run_of(key: tuple[int, float]) -> list[int]:
        """Return the shapes with ``key`` that can be painted one after another."""
        run: list[int] = []
        todo = [i for i in reversed(ready) if keys[i] == key]
        left: dict[int, int] = {}
        while todo:
            i = todo.pop()
            run.append(i)
            for j in above[i]:
                left[j] = left.get(j, below[j]) - 1
                if left[j] == 0 and keys[j] == key:
                    todo.append(j)
        return run

    ready = [i for i in range(len(keys)) if below[i] == 0]
    order: list[int] = []
    while ready:
        run = max(map(run_of, sorted({keys[i] for i in ready})), key=len)
        order += run
        for j in itertools.chain.from_iterable(above[i] for i in run):
            below[j] -= 1
        freed = {j for i in run for j in above[i] if below[j] == 0}
        ready = sorted((set(ready) | freed) - set(run))
    return order
