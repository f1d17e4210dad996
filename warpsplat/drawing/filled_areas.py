"""Filled areas beside the lines of line art, as fills."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from warpsplat.drawing.fit_outlines import Refinement
from warpsplat.drawing.strokes.lines import TracedLines
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.constraints import Drawing
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Scene


class Filled(NamedTuple):
    """Fills, and the grid that they lie on."""

    scene: Scene
    """``layer`` is the pen of each."""
    per_pixel: float
    """Units of the view box a pixel."""


def filled(
    traced: TracedLines,
    backend: Backend,
    finest: float,
    stop: Callable[[], bool] | None = None,
    *,
    tidy: bool = True,
) -> Filled:
    """The areas of ``traced`` in the colours of their pens, traced as a drawing is.

    Args:
        traced: line art with areas.
        backend: where to compute.
        finest: most units of the view box a pixel.
        stop: asked after every step; once true, what there is is taken.
        tidy: whether their outlines lose needless nodes.
    """
    scene, per_pixel = traced.scene.take(np.zeros(0, np.intp)), 1.0
    if traced.areas is None:
        return Filled(scene, per_pixel)
    for pen in np.unique(traced.area_pens).tolist():
        own = np.append(False, traced.area_pens == pen)[traced.areas.labels]
        # A pixel beside an area may be covered by its edge.
        near = cv2.dilate(own.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        ink = np.zeros((*near.shape, 4), np.float32)
        ink[..., 3] = np.where(near, traced.areas.cover, 0)
        found = trace(ink)
        drawing = Drawing(found.scene, found.joints, found.same)
        done = finish_drawing(ink, drawing, backend, Refinement(), finest=finest, tidy=tidy, stop=stop)
        shapes, count = done.drawing.scene, len(done.drawing.scene)
        shapes = replace(
            shapes,
            layer=np.full(count, pen, np.int32),
            colors=np.repeat(traced.pens[pen][None], count, axis=0),
            opacities=np.ones(count, np.float32),
        )
        scene, per_pixel = scene.append(shapes), max(per_pixel, done.per_pixel)
    return Filled(scene, per_pixel)
