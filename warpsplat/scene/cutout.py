"""Drawings without overlaps: of each shape only what is seen of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.scene.attributes import Basis, Kind, Paint
from warpsplat.scene.scene import Floats, Scene
from warpsplat.scene.simple import (
    GROWN,
    Painted,
    free_fills,
    joined,
    least_area,
    merged,
    moved_left,
    polygon_ring,
    reversed_ring,
    with_rings,
)

CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float64)


def cut_out(scene: Scene, per_pixel: float) -> Scene:
    """Return a scene that looks the same, in which no fill lies under an opaque one in front of it.

    Fills of one opaque colour become one, so that no line is left between them, and the background a fill.
    What is beyond the canvas goes. Strokes, and fills with one, stay as they are and hide nothing. Contours
    are rounded as by ``simple``.
    """
    scene = _with_background(scene)
    least, made = least_area(per_pixel), dict[int, list[Floats]]()
    above: list[Floats] = []
    size = per_pixel * np.array([scene.canvas.width, scene.canvas.height])
    page = [polygon_ring(size * CORNERS)]
    is_solid = (scene.paint == Paint.FLAT) & (scene.opacities >= 1)
    of_color: dict[bytes, int] = {}
    for shape in reversed(free_fills(scene)):
        rings = merged(scene, shape, per_pixel)
        if any((ring.min(axis=(0, 1)) < 0).any() or (ring.max(axis=(0, 1)) > size).any() for ring in rings):
            rings = intersection(rings, page, least)
        near, far = near_rings(above, rings)
        made[shape] = difference(rings, near, least)
        if scene.opacities[shape] >= 1:
            above = [*far, *union(near, rings, least)]
        if is_solid[shape]:
            front = of_color.setdefault(scene.colors[shape].tobytes(), shape)
            if front != shape:
                near, far = near_rings(made[front], made[shape])
                made[front], made[shape] = [*far, *union(near, made[shape], least)], []
    return with_rings(scene, made, per_pixel)


def union(rings: list[Floats], others: list[Floats], least: float) -> list[Floats]:
    """Return the rings around what either of two shapes covers; arguments as for ``difference``."""
    return _combined(rings, others, GROWN, lambda turns: turns > 0, least)


def intersection(rings: list[Floats], others: list[Floats], least: float) -> list[Floats]:
    """Return the rings around what both of two shapes cover; arguments as for ``difference``."""
    return _combined(rings, others, GROWN, lambda turns: turns > 1, least)


def difference(rings: list[Floats], others: list[Floats], least: float) -> list[Floats]:
    """Return the rings around what one shape covers and another does not.

    Args:
        rings: Of the first shape, simple ones that run around it (``simple.bounding``), in units.
        others: Of the second one.
        least: Area of rings that are left out [units²].
    """
    return _combined(rings, [reversed_ring(ring) for ring in others], -GROWN, lambda turns: turns > 0, least)


def near_rings(rings: list[Floats], others: list[Floats]) -> tuple[list[Floats], list[Floats]]:
    """Return the rings whose boxes meet that of the others, and the rest."""
    every = np.concatenate([*others, np.full((0, 4, 2), 0.0)]).reshape(-1, 2)
    if not len(every):
        return [], rings
    low, high = every.min(axis=0) - 1, every.max(axis=0) + 1
    meet = [bool(((ring.min(axis=(0, 1)) <= high) & (low <= ring.max(axis=(0, 1)))).all()) for ring in rings]
    near, far = (
        [ring for ring, is_near in zip(rings, meet, strict=True) if is_near == wanted]
        for wanted in (True, False)
    )
    return near, far


def _with_background(scene: Scene) -> Scene:
    """Return a scene with its background, if any, as a shape."""
    canvas = scene.canvas
    if canvas.background is None:
        return scene
    bare = replace(canvas, background=None)
    size = np.array([canvas.width, canvas.height], np.float64)
    points = polygon_ring(size * CORNERS)[:, :3].reshape(1, -1, 2).astype(np.float32)
    behind = Scene.uniform(Kind.FILL, bare, points, Basis.CUBIC)
    behind = replace(
        behind, colors=canvas.background[None].astype(np.float32), opacities=np.ones(1, np.float32)
    )
    return behind.append(replace(scene, canvas=bare))


def _combined(
    rings: list[Floats], others: list[Floats], grown: float, painted: Painted, least: float
) -> list[Floats]:
    """Return the rings around what two kinds of rings wind around as often as is ``painted``.

    ``grown``: how far the others are moved to their left, on a screen, while crossings are looked for.
    """
    fixed = [np.concatenate([ring, ring], axis=2) for ring in rings]
    moved = [np.concatenate([ring, moved_left(ring, grown)], axis=2) for ring in others]
    return joined([*fixed, *moved], painted, least)
