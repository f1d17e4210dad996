"""The order in which a plotter draws strokes: little travel with the pen lifted.

Strokes are given by their ends, shape (2, stroke, 2): where each begins and ends. A tour is an order of them,
and 1 for each one in it that is drawn backwards, 0 for the others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Basis, IndexArray, Scene
from warpsplat.scene.scene import ranges

LOOK_AHEAD = 1500
"""Strokes of the longest part of a tour that is reversed, and of a tour that is improved more than once."""

Tour = tuple[Ints, Ints]


def toured(scene: Scene) -> Scene:
    """Order the strokes of each layer to minimise pen-up travel; some are drawn backwards.

    Strokes of several contours keep their direction.
    """
    ends = _ends(scene)
    order: list[int] = []
    reversed_: list[int] = []
    here = np.zeros(2)
    for layer in np.unique(scene.layer).tolist():
        index = np.flatnonzero(scene.layer == layer)
        own = ends[:, index]
        as_given = np.arange(len(index)), np.zeros(len(index), np.intp)
        tours = (_improved(own, tour) for tour in (_greedy(own, here), as_given))
        tour = min(tours, key=lambda tour: _travel(own, tour))
        order += index[tour[0]].tolist()
        reversed_ += tour[1].tolist()
        if len(index):
            here = ends[1 - reversed_[-1], order[-1]]
    scene = scene.take(np.array(order, np.intp))
    return _with_rings_begun_nearby(_with_reversed(scene, np.array(reversed_, np.bool_)))


def _ends(scene: Scene) -> Floats:
    """Return the ends of the strokes; rings end where they begin."""
    starts = scene.points[scene.first[:-1]].astype(np.float64)
    last = scene.points[scene.first[1:] - 1].astype(np.float64)
    ring = scene.closed[np.searchsorted(scene.starts, scene.first[1:]) - 1] == 1
    return np.stack([starts, np.where(ring[:, None], starts, last)])


def _travel(ends: Floats, tour: Tour) -> float:
    """Return the length of a tour between its strokes."""
    order, turned = tour
    return float(hypot(*(ends[turned, order][1:] - ends[1 - turned, order][:-1]).T).sum())


def _greedy(ends: Floats, here: Floats) -> Tour:
    """Return the tour from ``here`` that always goes on to the nearest end."""
    count = ends.shape[1]
    places = ends.reshape(-1, 2)
    left = np.arange(2 * count)
    order, turned = np.zeros(count, np.intp), np.zeros(count, np.intp)
    for step in range(count):
        away = places[left] - here
        turned[step], order[step] = divmod(int(left[(away * away).sum(axis=1).argmin()]), count)
        here = ends[1 - turned[step], order[step]]
        left = left[left % count != order[step]]
    return order, turned


def _improved(ends: Floats, tour: Tour) -> Tour:
    """Return a tour shortened by reversing parts of it (2-opt)."""
    while True:
        before, tour = _travel(ends, tour), _with_reversed_parts(ends, tour)
        if len(tour[0]) > LOOK_AHEAD or not _travel(ends, tour) < before:
            return tour


def _with_reversed_parts(ends: Floats, tour: Tour) -> Tour:
    """Return a tour with each part of up to LOOK_AHEAD strokes reversed, where that shortens it."""
    order, turned = tour[0].copy(), tour[1].copy()
    count = len(order)
    entries, exits = ends[turned, order], ends[1 - turned, order]
    for low in range(count):
        high = np.arange(low, min(low + LOOK_AHEAD, count))
        now, then = np.zeros(len(high)), np.zeros(len(high))
        if low:
            now += hypot(*(entries[low] - exits[low - 1]))
            then += hypot(*(exits[high] - exits[low - 1]).T)
        inner = high < count - 1
        following = np.minimum(high + 1, count - 1)
        now += inner * hypot(*(entries[following] - exits[high]).T)
        then += inner * hypot(*(entries[following] - entries[low]).T)
        best = int((then - now).argmin())
        if then[best] < now[best]:
            part = slice(low, int(high[best]) + 1)
            order[part], turned[part] = order[part][::-1].copy(), 1 - turned[part][::-1]
            entries[part], exits[part] = exits[part][::-1].copy(), entries[part][::-1].copy()
    return order, turned


def _is_simple(scene: Scene, *, closed: bool) -> Bools:
    """Return which strokes have one contour, and it is ``closed`` or not."""
    first = np.searchsorted(scene.starts, scene.first)
    return (np.diff(first) == 1) & ((scene.closed[first[:-1]] == 1) == closed)


def _with_reversed(scene: Scene, backwards: Bools) -> Scene:
    """Return the strokes of one open contour with their points in reverse where they are drawn backwards."""
    index: IndexArray = ranges(scene.first[:-1], scene.point_counts())
    for shape in np.flatnonzero(backwards & _is_simple(scene, closed=False)).tolist():
        low, high = scene.first[shape : shape + 2]
        index[low:high] = index[low:high][::-1]
    return replace(scene, points=scene.points[index])


def _with_rings_begun_nearby(scene: Scene) -> Scene:
    """Return the rings of cubics begun where the pen comes by."""
    starts, ends = _ends(scene)
    points = scene.points.copy()
    for shape in np.flatnonzero(_is_simple(scene, closed=True) & (scene.basis == Basis.CUBIC)).tolist():
        own = scene.points_of(shape)
        near = [ends[shape - 1]] if shape else []
        near += [starts[shape + 1]] if shape + 1 < len(scene) else []
        away = np.sum([hypot(*(own[::3] - place).T) for place in near], axis=0)
        begin = 3 * int(np.argmin(away)) if near else 0
        points[scene.first[shape] : scene.first[shape + 1]] = np.roll(own, -begin, axis=0)
        starts[shape] = ends[shape] = own[begin]
    return replace(scene, points=points)
