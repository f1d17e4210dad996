"""Stencils: bridges from islands, which would fall out, to what surrounds them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warpsplat.portable import elementary
from warpsplat.scene.connected import parts_of
from warpsplat.scene.cutout import difference, near_rings
from warpsplat.scene.scene import Floats, Scene
from warpsplat.scene.simple import free_fills, least_area, merged, polygon, polygon_ring, with_rings


def bridged(scene: Scene, per_pixel: float, width: float) -> Scene:
    """Return a scene with bridges, ``width`` px wide, over the fills from each hole to what is around it.

    Each hole gets one where the way is shortest, and a short one to the other side. Contours are rounded as
    by ``simple``.
    """
    least = least_area(per_pixel)
    made: dict[int, list[Floats]] = {shape: [] for shape in free_fills(scene)}
    for shape, outer, holes in _parts(scene, per_pixel):
        left = [outer, *holes]
        for hole in holes:
            for bridge in _bridges(polygon(hole), polygon(outer), width * per_pixel):
                near, far = near_rings(left, [bridge])
                left = [*far, *difference(near, [bridge], least)]
        made[shape] += left
    return with_rings(scene, made, per_pixel)


def hole_widths(scene: Scene, per_pixel: float) -> list[float]:
    """Return the smaller side of the box around each hole in the fills [px]."""
    boxes = [np.ptp(polygon(hole), axis=0) for *_, holes in _parts(scene, per_pixel) for hole in holes]
    return [float(box.min()) / per_pixel for box in boxes]


def _parts(scene: Scene, per_pixel: float) -> Iterator[tuple[int, Floats, list[Floats]]]:
    """Yield each connected part of the fills: the shape that it is of, its outer ring, its holes."""
    for shape in free_fills(scene):
        for outer, *holes in parts_of(merged(scene, shape, per_pixel)):
            yield shape, outer, holes


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
    return polygon_ring(np.round([start - across, end - across, end + across, start + across]))
