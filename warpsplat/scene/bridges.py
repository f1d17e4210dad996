"""Stencils: bridges from islands, which would fall out, to what surrounds them."""

from __future__ import annotations

import numpy as np

from warpsplat.portable import elementary
from warpsplat.scene.attributes import Rule
from warpsplat.scene.connected import parts_of
from warpsplat.scene.cutout import difference
from warpsplat.scene.scene import Scene
from warpsplat.scene.simple import (
    LEAST,
    PAINTED,
    Floats,
    free_fills,
    merged,
    polygon,
    rings_of,
    with_rings,
)


def bridged(scene: Scene, per_pixel: float, width: float) -> Scene:
    """Return a scene with bridges over the fills from each hole to what is around the part that it is in.

    Each hole gets one where the way is shortest, and a short one to the other side. Contours are
    rounded as by ``simple``.

    Args:
        scene: What to cut out.
        per_pixel: As for ``simple``.
        width: Of a bridge [px].
    """
    least, made = LEAST * per_pixel * per_pixel, dict[int, list[Floats]]()
    for shape in free_fills(scene):
        painted = PAINTED[Rule(scene.rule[shape])]
        rings = merged(rings_of(scene, shape, per_pixel), painted, least)
        made[shape] = []
        for outer, *holes in parts_of(rings):
            left = [outer, *holes]
            for hole in holes:
                for bridge in _bridges(polygon(hole), polygon(outer), width * per_pixel):
                    left = difference(left, [bridge], least)
            made[shape] += left
    return with_rings(scene, made, per_pixel)


def _bridges(hole: Floats, outer: Floats, width: float) -> list[Floats]:
    """Return two rectangles from a hole to the outer ring around it, as rings of cubics."""
    steps = outer[None] - hole[:, None]
    lengths = elementary.hypot(steps[..., 0], steps[..., 1])
    first = np.unravel_index(lengths.argmin(), lengths.shape)
    # The farther round it is, the longer the second one may be.
    opposite = -(steps * steps[first]).sum(axis=2) / np.maximum(lengths * lengths[first], 1e-9)
    second = np.unravel_index((opposite / np.maximum(lengths, 1e-9)).argmax(), lengths.shape)
    return [_rectangle(hole[i], outer[j], width) for i, j in (first, second)]


def _rectangle(start: Floats, end: Floats, width: float) -> Floats:
    """Return a rectangle of a width from one point to beyond another, which runs clockwise on a screen."""
    along = (end - start) / max(float(elementary.hypot(*(end - start))), 1e-9)
    across = 0.5 * width * np.array([-along[1], along[0]])
    start, end = start - 0.5 * width * along, end + 0.5 * width * along
    corners = np.round([start - across, end - across, end + across, start + across])
    following = np.roll(corners, -1, axis=0)
    return np.stack(
        [corners, (2 * corners + following) / 3, (corners + 2 * following) / 3, following], axis=1
    )
