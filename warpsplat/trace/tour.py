"""The order in which a plotter draws strokes: little way with the pen lifted."""

from __future__ import annotations

import numpy as np

from warpsplat.scene import IndexArray, Scene
from warpsplat.scene.scene import ranges
from warpsplat.trace.grids import Bools, Floats, Ints

LOOK_AHEAD = 60
"""Strokes of the tour among which a part of it may be turned round."""

TURNS = 4
"""Times that the tour is gone through for such parts."""


def pen_up(scene: Scene) -> float:
    """Way of the lifted pen from each stroke's end to the next one's start [canvas units].

    Between pens as well; the ways from and to the plotter's corner are not counted.
    """
    starts, ends = _ends(scene)
    return float(np.hypot(*(starts[1:] - ends[:-1]).T).sum())


def toured(scene: Scene) -> Scene:
    """The strokes of ``scene`` in an order of little way with the pen lifted, some drawn from their ends;
    each layer by itself. Strokes of several contours stay as they are drawn.
    """
    starts, ends = _ends(scene)
    order: list[int] = []
    backwards: list[bool] = []
    here = np.zeros(2)
    for layer in np.unique(scene.layer).tolist():
        index = np.flatnonzero(scene.layer == layer)
        tours = (
            _improved(starts[index], ends[index], *first)
            for first in (
                _greedy(starts[index], ends[index], here),
                (np.arange(len(index)), np.zeros(len(index), np.bool_)),
            )
        )
        tour, turned = min(tours, key=lambda found: _lifted(starts[index], ends[index], *found))
        order += index[tour].tolist()
        backwards += turned.tolist()
        if len(tour):
            here = starts[order[-1]] if backwards[-1] else ends[order[-1]]
    return _turned(scene.take(np.array(order, np.intp)), np.array(backwards, np.bool_))


def _ends(scene: Scene) -> tuple[Floats, Floats]:
    """Where the strokes begin and end, shape (shape, 2) each; rings end where they begin."""
    starts = scene.points[scene.first[:-1]].astype(np.float64)
    last = scene.points[scene.first[1:] - 1].astype(np.float64)
    ring = scene.closed[np.searchsorted(scene.starts, scene.first[1:]) - 1] == 1
    return starts, np.where(ring[:, None], starts, last)


def _greedy(starts: Floats, ends: Floats, here: Floats) -> tuple[Ints, Bools]:
    """The nearest end next, from ``here`` on: numbers of strokes, and whether each is turned round."""
    count = len(starts)
    both = np.concatenate([starts, ends])
    left = np.arange(2 * count)
    tour, turned = np.zeros(count, np.intp), np.zeros(count, np.bool_)
    for step in range(count):
        away = both[left] - here
        near = int(left[(away * away).sum(axis=1).argmin()])
        stroke, is_end = near % count, near >= count
        tour[step], turned[step] = stroke, is_end
        here = starts[stroke] if is_end else ends[stroke]
        left = left[(left != stroke) & (left != stroke + count)]
    return tour, turned


def _lifted(starts: Floats, ends: Floats, tour: Ints, turned: Bools) -> float:
    """Way of the lifted pen on a tour."""
    entries = np.where(turned[:, None], ends[tour], starts[tour])
    exits = np.where(turned[:, None], starts[tour], ends[tour])
    return float(np.hypot(*(entries[1:] - exits[:-1]).T).sum())


def _improved(starts: Floats, ends: Floats, tour: Ints, turned: Bools) -> tuple[Ints, Bools]:
    """Parts of a tour turned round where that shortens it (2-opt, the parts up to LOOK_AHEAD long)."""
    count = len(tour)
    tour, turned = tour.copy(), turned.copy()
    entries = np.where(turned[:, None], ends[tour], starts[tour])
    exits = np.where(turned[:, None], starts[tour], ends[tour])
    for _ in range(TURNS):
        is_shorter = False
        for low in range(1, count):
            high = np.arange(low, min(low + LOOK_AHEAD, count))
            before = exits[low - 1]
            now = np.hypot(*(entries[low] - before)) + np.zeros(len(high))
            then = np.hypot(*(exits[high] - before).T)
            inner = high < count - 1
            following = np.minimum(high + 1, count - 1)
            now += inner * np.hypot(*(entries[following] - exits[high]).T)
            then += inner * np.hypot(*(entries[following] - entries[low]).T)
            best = int((then - now).argmin())
            if then[best] - now[best] < -1e-6:
                part = slice(low, int(high[best]) + 1)
                tour[part], turned[part] = tour[part][::-1].copy(), ~turned[part][::-1]
                entries[part], exits[part] = exits[part][::-1].copy(), entries[part][::-1].copy()
                is_shorter = True
        if not is_shorter:
            break
    return tour, turned


def _turned(scene: Scene, backwards: Bools) -> Scene:
    """Strokes of one contour with their points in reverse."""
    from dataclasses import replace

    one = np.diff(np.searchsorted(scene.starts, scene.first)) == 1
    ring = scene.closed[np.searchsorted(scene.starts, scene.first[:-1])] == 1
    index: IndexArray = ranges(scene.first[:-1], scene.point_counts())
    for shape in np.flatnonzero(backwards & one & ~ring).tolist():
        low, high = scene.first[shape : shape + 2]
        index[low:high] = index[low:high][::-1]
    return replace(scene, points=scene.points[index])
