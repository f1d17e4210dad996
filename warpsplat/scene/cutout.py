"""Drawings without overlaps: of each shape only what is seen of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.portable import elementary
from warpsplat.scene.attributes import Basis, Kind, Paint, Rule
from warpsplat.scene.scene import IndexArray, Scene
from warpsplat.scene.simple import (
    LEAST,
    PAINTED,
    Floats,
    bounding,
    free_fills,
    reversed_ring,
    rings_of,
    simple_rings,
    with_rings,
)

GROWN = 0.02
"""By how much shapes are grown while crossings are looked for [units]: edges that coincide then cross."""


def cut_out(scene: Scene, per_pixel: float) -> Scene:
    """Return a scene that looks the same, in which no fill lies under an opaque one in front of it.

    Fills of one opaque colour become one, so that no line is left between them, and the background a fill.
    Strokes, and fills with one, stay as they are and hide nothing. Contours are rounded as by ``simple``.
    """
    scene = _with_background(scene)
    least, made = LEAST * per_pixel * per_pixel, dict[int, list[Floats]]()
    above: list[Floats] = []
    is_solid = (scene.paint == Paint.FLAT) & (scene.opacities >= 1)
    of_color: dict[bytes, int] = {}
    for shape in reversed(free_fills(scene)):
        painted = PAINTED[Rule(scene.rule[shape])]
        rings = bounding(simple_rings(rings_of(scene, shape, per_pixel), painted, least), [], painted, least)
        near, far = _near(above, rings)
        made[shape] = difference(rings, near, least)
        if scene.opacities[shape] >= 1:
            above = [*far, *union(near, rings, least)]
        if is_solid[shape]:
            front = of_color.setdefault(scene.colors[shape].tobytes(), shape)
            if front != shape:
                near, far = _near(made[front], made[shape])
                made[front], made[shape] = [*far, *union(near, made[shape], least)], []
    return with_rings(scene, made, per_pixel)


def union(rings: list[Floats], others: list[Floats], least: float) -> list[Floats]:
    """Return the rings around what either of two shapes covers; arguments as for ``difference``."""
    return _combined(rings, others, GROWN, least)


def difference(rings: list[Floats], others: list[Floats], least: float) -> list[Floats]:
    """Return the rings around what one shape covers and another does not.

    Args:
        rings: Of the first shape, simple ones that run around it (``simple.bounding``), in units.
        others: Of the second one.
        least: Area of rings that are left out [units²].
    """
    return _combined(rings, [reversed_ring(ring) for ring in others], -GROWN, least)


def _near(rings: list[Floats], others: list[Floats]) -> tuple[list[Floats], list[Floats]]:
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
    corners = np.array([(0, 0), (canvas.width, 0), (canvas.width, canvas.height), (0, canvas.height)])
    thirds = np.arange(3)[:, None] / 3
    sides = corners[:, None] + thirds * (np.roll(corners, -1, axis=0) - corners)[:, None]
    bare = replace(canvas, background=None)
    behind = Scene.uniform(Kind.FILL, bare, sides.reshape(1, -1, 2).astype(np.float32), Basis.CUBIC)
    behind = replace(
        behind, colors=canvas.background[None].astype(np.float32), opacities=np.ones(1, np.float32)
    )
    return behind.append(replace(scene, canvas=bare))


def _combined(rings: list[Floats], others: list[Floats], grown: float, least: float) -> list[Floats]:
    """Return the rings around what is to the right, on a screen, of rings of either kind.

    ``grown``: how far the others are moved to their left while crossings are looked for.
    """
    fixed = [np.concatenate([ring, ring], axis=2) for ring in rings]
    moved = [np.concatenate([ring, _grown(ring, grown)], axis=2) for ring in others]
    made = simple_rings([*fixed, *moved], _is_filled, least)
    return [ring[..., :2] for ring in bounding(made, [], _is_filled, least)]


def _is_filled(turns: IndexArray) -> npt.NDArray[np.bool_]:
    return turns > 0


def _grown(ring: Floats, distance: float) -> Floats:
    """Return a ring of cubics with its nodes moved to the left on a screen, and the handles with them."""
    ends = [ring[:, 1:] - ring[:, :1], (ring[:, 3:] - ring[:, 2::-1])]
    after, before = (_first_directions(steps) for steps in ends)
    side = after + np.roll(before, 1, axis=0)
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1)
    normal = distance * normal / np.maximum(elementary.hypot(*normal.T), 1e-9)[:, None]
    following = np.roll(normal, -1, axis=0)
    return ring + np.stack([normal, normal, following, following], axis=1)


def _first_directions(steps: Floats) -> Floats:
    """Return the direction of the first step that has one: (cubic, step, 2) -> (cubic, 2)."""
    lengths = elementary.hypot(steps[..., 0], steps[..., 1])
    rows, first = np.arange(len(steps)), (lengths > 0).argmax(axis=1)
    return np.asarray(steps[rows, first] / np.maximum(lengths[rows, first], 1e-9)[:, None])
