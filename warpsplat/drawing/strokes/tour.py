"""The order in which a plotter draws strokes: little travel with the pen lifted.

Strokes are given by their ends, shape (2 * stroke, 2): where each begins, then where each ends. A tour is an
order of the ends at which the pen is put down; it is lifted at the others (``_others``).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.scene import IndexArray, Scene
from warpsplat.scene.scene import ranges

LOOK_AHEAD = 1500
"""Strokes of the longest part of a tour that is reversed, and of a tour that is improved more than once."""


def toured(scene: Scene) -> Scene:
    """Order the strokes of each layer, of one contour each, to minimise pen-up travel.

    Some are drawn backwards, and rings from another place on.
    """
    ends = _ends(scene)
    order, turned, here = np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(2)
    for layer in np.unique(scene.layer).tolist():
        index = np.flatnonzero(scene.layer == layer)
        places = ends[:, index].reshape(-1, 2)
        tour = _improved(places, _greedy(places, here))
        backwards, strokes = np.divmod(tour, len(index))
        order, turned = np.append(order, index[strokes]), np.append(turned, backwards)
        here = places[_others(tour, len(index))[-1]]
    scene = scene.take(order)
    points: IndexArray = ranges(scene.first[:-1], scene.point_counts())
    for stroke in np.flatnonzero((turned == 1) & (scene.closed == 0)).tolist():
        own = slice(*scene.first[stroke : stroke + 2])
        points[own] = points[own][::-1]
    return _with_rings_begun_nearby(replace(scene, points=scene.points[points]))


def _ends(scene: Scene) -> Floats:
    """Return where strokes begin and end, shape (2, stroke, 2); rings end where they begin."""
    first = scene.first[:-1]
    last = np.where(scene.closed == 1, first, scene.first[1:] - 1)
    return scene.points[np.stack([first, last])].astype(np.float64)


def _others(ends: Ints, count: int) -> Ints:
    """Return the other ends of strokes, of which there are ``count``."""
    return (ends + count) % (2 * count)


def _travel(places: Floats, tour: Ints) -> float:
    """Return the length of a tour between its strokes."""
    return float(hypot(*(places[tour][1:] - places[_others(tour, len(tour))][:-1]).T).sum())


def _greedy(places: Floats, here: Floats) -> Ints:
    """Return the tour from ``here`` that always goes on to the nearest end."""
    count = len(places) // 2
    left, tour = np.arange(2 * count), np.zeros(count, np.intp)
    for step in range(count):
        away = places[left] - here
        tour[step] = left[(away * away).sum(axis=1).argmin()]
        here = places[_others(tour[step], count)]
        left = left[left % count != tour[step] % count]
    return tour


def _improved(places: Floats, tour: Ints) -> Ints:
    """Return a tour shortened by reversing parts of it (2-opt)."""
    while True:
        before, tour = _travel(places, tour), _with_reversed_parts(places, tour)
        if len(tour) > LOOK_AHEAD or not _travel(places, tour) < before:
            return tour


def _with_reversed_parts(places: Floats, tour: Ints) -> Ints:
    """Return a tour with each part of up to LOOK_AHEAD strokes reversed, where that shortens it."""
    tour, count = tour.copy(), len(tour)
    for low in range(count):
        high = np.arange(low, min(low + LOOK_AHEAD, count))
        now, then = np.zeros(len(high)), np.zeros(len(high))
        entries, exits = places[tour], places[_others(tour, count)]
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
            tour[part] = _others(tour[part][::-1], count)
    return tour


def _with_rings_begun_nearby(scene: Scene) -> Scene:
    """Return strokes, rings begun where the pen comes by."""
    starts, ends = _ends(scene)
    points = scene.points.copy()
    for shape in np.flatnonzero(scene.closed == 1).tolist():
        own = scene.points_of(shape)
        near = [ends[shape - 1]] if shape else []
        near += [starts[shape + 1]] if shape + 1 < len(scene) else []
        away = np.sum([hypot(*(own[::3] - place).T) for place in near], axis=0)
        begin = 3 * int(np.argmin(away)) if near else 0
        points[scene.first[shape] : scene.first[shape + 1]] = np.roll(own, -begin, axis=0)
        starts[shape] = ends[shape] = own[begin]
    return replace(scene, points=points)
