"""The order in which a plotter draws strokes: little travel with the pen lifted.

Strokes are given by their ends, shape (2 * stroke, 2): where each begins, then where each ends. A tour is an
order of the ends at which the pen is put down; it is lifted at the others (``_others``).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Scene


def toured(scene: Scene) -> Scene:
    """Order the strokes of each layer, of one contour each, to minimise pen-up travel.

    Some are drawn backwards, and rings from where the pen comes by.
    """
    first = scene.first[:-1]
    last = np.where(scene.closed == 1, first, scene.first[1:] - 1)
    ends = scene.points[np.stack([first, last])].astype(np.float64)
    order, points, here = [], [], np.zeros(2)
    for layer in np.unique(scene.layer).tolist():
        index = np.flatnonzero(scene.layer == layer)
        places = ends[:, index].reshape(-1, 2)
        for backwards, stroke in np.stack(np.divmod(_tour(places, here), len(index)), axis=1).tolist():
            order.append(int(index[stroke]))
            own = scene.points_of(order[-1])
            if scene.closed[order[-1]]:
                own = np.roll(own, -3 * int(hypot(*(own[::3] - here).T).argmin()), axis=0)
            elif backwards:
                own = own[::-1]
            points.append(own)
            here = own[0 if scene.closed[order[-1]] else -1]
    return replace(scene.take(np.array(order, np.intp)), points=np.concatenate(points))


def _others(ends: Ints, count: int) -> Ints:
    """Return the other ends of strokes, of which there are ``count``."""
    return (ends + count) % (2 * count)


def _tour(places: Floats, here: Floats) -> Ints:
    """Return the tour from ``here`` that goes on to the nearest end, shortened by reversing parts (2-opt)."""
    count = len(places) // 2
    left, tour = np.arange(2 * count), np.zeros(count, np.intp)
    for step in range(count):
        away = places[left] - here
        tour[step] = left[(away * away).sum(axis=1).argmin()]
        here = places[_others(tour[step], count)]
        left = left[left % count != tour[step] % count]
    while _shorten(places, tour):
        pass
    return tour


def _shorten(places: Floats, tour: Ints) -> bool:
    """Reverse parts of a tour where that shortens it, and return whether it does anywhere."""
    count, is_shorter = len(tour), False
    for low in range(count):
        entries, exits = places[tour], places[_others(tour, count)]
        saved = np.zeros(count - low)
        if low:
            saved += hypot(*(entries[low] - exits[low - 1])) - hypot(*(exits[low:] - exits[low - 1]).T)
        after = entries[low + 1 :]
        saved[:-1] += hypot(*(after - exits[low:-1]).T) - hypot(*(after - entries[low]).T)
        best = int(saved.argmax())
        if saved[best] > 1e-9:
            tour[low : low + best + 1] = _others(tour[low : low + best + 1][::-1], count)
            is_shorter = True
    return is_shorter
