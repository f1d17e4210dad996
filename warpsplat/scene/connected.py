"""Fills as one shape for each connected part."""

from __future__ import annotations

import numpy as np

from warpsplat.scene.scene import Floats, Scene
from warpsplat.scene.simple import area, free_fills, merged, polygon, windings, with_rings


def separated(scene: Scene, per_pixel: float) -> Scene:
    """Return a scene that looks the same with a shape for each connected part of a fill, its holes with it.

    Contours are made simple as by ``simple``, on the same grid. Shapes that are filled and stroked, and those
    of a form, stay.
    """
    made: dict[int, list[Floats]] = {}
    rows: list[int] = []
    free = set(free_fills(scene))
    for shape in range(len(scene)):
        if shape not in free:
            rows.append(shape)
            continue
        for part in parts_of(merged(scene, shape, per_pixel)):
            made[len(rows)] = part
            rows.append(shape)
    return with_rings(scene.take(np.array(rows, np.intp)), made, per_pixel)


def parts_of(rings: list[Floats]) -> list[list[Floats]]:
    """Return simple rings by connected parts: an outer one, which runs clockwise, and the holes in it."""
    lines = [polygon(ring) for ring in rings]
    areas = [area(line) for line in lines]
    outer = [i for i in range(len(rings)) if areas[i] > 0]
    parts = {i: [rings[i]] for i in outer}
    for hole in sorted(set(range(len(rings))) - set(outer)):
        # A hole may touch what is around it, in a point.
        around = [
            i for i in outer if 2 * int((windings([lines[i]], lines[hole]) > 0).sum()) > len(lines[hole])
        ]
        if around:
            parts[min(around, key=areas.__getitem__)].append(rings[hole])
    return list(parts.values())
