"""The order in which a plotter draws strokes: little way with the pen lifted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Basis, IndexArray, Scene
from warpsplat.scene.scene import ranges

LOOK_AHEAD = 1500
"""Strokes of the tour among which a part of it may be turned round."""

FEW, BEGINS = 200, 8
"""Strokes up to which tours from several places are tried, and how many places."""

MANY = 1500
"""Strokes from which on a tour is improved once, by turning parts alone."""

TURNS = 8
"""Times that a tour is gone through at the most."""


def pen_up(scene: Scene) -> float:
    """Way of the lifted pen from each stroke's end to the next one's start [canvas units].

    Between pens as well; the ways from and to the plotter's corner are not counted.
    """
    starts, ends = _ends(scene)
    return float(hypot(*(starts[1:] - ends[:-1]).T).sum())


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
        begins = [here, *starts[index[:: max(1, -(-len(index) // BEGINS))]]] if len(index) <= FEW else [here]
        first = [_greedy(starts[index], ends[index], begin) for begin in begins]
        first.append((np.arange(len(index)), np.zeros(len(index), np.bool_)))
        tours = [_improved(starts[index], ends[index], *tour) for tour in first]
        tour, turned = min(tours, key=lambda found: _lifted(starts[index], ends[index], *found))
        order += index[tour].tolist()
        backwards += turned.tolist()
        if len(tour):
            here = starts[order[-1]] if backwards[-1] else ends[order[-1]]
    return _rings_begun(_turned(scene.take(np.array(order, np.intp)), np.array(backwards, np.bool_)))


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
    return float(hypot(*(entries[1:] - exits[:-1]).T).sum())


def _improved(starts: Floats, ends: Floats, tour: Ints, turned: Bools) -> tuple[Ints, Bools]:
    """Parts of a tour turned round (2-opt), and single strokes moved (Or-opt), where that shortens it."""
    tour, turned = tour.copy(), turned.copy()
    for _ in range(TURNS if len(tour) <= MANY else 1):
        before = _lifted(starts, ends, tour, turned)
        _turn_parts(starts, ends, tour, turned)
        if len(tour) <= MANY:
            tour, turned = _with_moves(starts, ends, tour, turned)
        if _lifted(starts, ends, tour, turned) > before - 1e-6:
            break
    return tour, turned


def _turn_parts(starts: Floats, ends: Floats, tour: Ints, turned: Bools) -> None:
    """Each part of up to LOOK_AHEAD strokes turned round, in place, where that shortens the tour."""
    count = len(tour)
    entries = np.where(turned[:, None], ends[tour], starts[tour])
    exits = np.where(turned[:, None], starts[tour], ends[tour])
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
        if then[best] - now[best] < -1e-6:
            part = slice(low, int(high[best]) + 1)
            tour[part], turned[part] = tour[part][::-1].copy(), ~turned[part][::-1]
            entries[part], exits[part] = exits[part][::-1].copy(), entries[part][::-1].copy()


def _with_moves(starts: Floats, ends: Floats, tour: Ints, turned: Bools) -> tuple[Ints, Bools]:
    """Each stroke but the first in the place of the tour where it costs least way."""
    for stroke in range(len(tour)):
        at = int(np.flatnonzero(tour == stroke)[0])
        if at == 0:
            continue
        rest, rest_turned = np.delete(tour, at), np.delete(turned, at)
        entries = np.where(rest_turned[:, None], ends[rest], starts[rest])
        exits = np.where(rest_turned[:, None], starts[rest], ends[rest])
        between = np.append(hypot(*(entries[1:] - exits[:-1]).T), 0.0)
        costs = []
        for entry, leave in ((starts[stroke], ends[stroke]), (ends[stroke], starts[stroke])):
            onwards = np.append(hypot(*(entries[1:] - leave).T), 0.0)
            costs.append(hypot(*(exits - entry).T) + onwards - between)
        is_end, place = divmod(int(np.argmin(costs)), len(rest))
        if costs[is_end][place] < costs[int(turned[at])][at - 1] - 1e-6:
            tour = np.insert(rest, place + 1, stroke)
            turned = np.insert(rest_turned, place + 1, bool(is_end))
    return tour, turned


def _turned(scene: Scene, backwards: Bools) -> Scene:
    """Strokes of one contour with their points in reverse."""
    one = np.diff(np.searchsorted(scene.starts, scene.first)) == 1
    ring = scene.closed[np.searchsorted(scene.starts, scene.first[:-1])] == 1
    index: IndexArray = ranges(scene.first[:-1], scene.point_counts())
    for shape in np.flatnonzero(backwards & one & ~ring).tolist():
        low, high = scene.first[shape : shape + 2]
        index[low:high] = index[low:high][::-1]
    return replace(scene, points=scene.points[index])


def _rings_begun(scene: Scene) -> Scene:
    """Rings drawn from where the pen comes by: rings of cubics, from one of the points on them."""
    starts, ends = _ends(scene)
    points = scene.points.copy()
    ring = scene.closed[np.searchsorted(scene.starts, scene.first[:-1])] == 1
    one = np.diff(np.searchsorted(scene.starts, scene.first)) == 1
    for shape in np.flatnonzero(ring & one & (scene.basis == Basis.CUBIC)).tolist():
        own = scene.points_of(shape)
        near = [ends[shape - 1]] if shape else []
        near += [starts[shape + 1]] if shape + 1 < len(scene) else []
        away = np.sum([hypot(*(own[::3] - place).T) for place in near], axis=0)
        begin = 3 * int(np.argmin(away)) if near else 0
        points[scene.first[shape] : scene.first[shape + 1]] = np.roll(own, -begin, axis=0)
        starts[shape] = ends[shape] = own[begin]
    return replace(scene, points=points)
