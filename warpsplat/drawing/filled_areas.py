"""Filled areas beside the lines of line art, as fills."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from warpsplat.drawing.strokes.lines import TracedLines
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.constraints import Drawing
from warpsplat.fit.problem import Run
from warpsplat.scene import Scene


class Filled(NamedTuple):
    """Fills, and their grid."""

    scene: Scene
    """``layer`` is the pen of each."""
    per_pixel: float
    """View box units per pixel."""


def filled(traced: TracedLines, run: Run, finest: float, *, tidy: bool = True) -> Filled:
    """Trace the areas of line art as a drawing, in the colours of their pens.

    Args:
        traced: line art with areas.
        run: how the work is carried out.
        finest: most view box units per pixel.
        tidy: whether their outlines lose needless nodes.
    """
    scene, per_pixel = traced.scene.take(np.zeros(0, np.intp)), 1.0
    if traced.areas is None:
        return Filled(scene, per_pixel)
    pens = np.unique(traced.area_pens).tolist()
    for number, pen in enumerate(pens):
        own = np.append(False, traced.area_pens == pen)[traced.areas.labels]
        # A pixel beside an area may be covered by its edge.
        near = cv2.dilate(own.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        ink = np.zeros((*near.shape, 4), np.float32)
        ink[..., 3] = np.where(near, traced.areas.cover, 0)
        found = trace(ink)
        drawing = Drawing(found.scene, found.joints, found.same)
        part = run.part(number / len(pens), (number + 1) / len(pens))
        done = finish_drawing(ink, drawing, part, finest=finest, tidy=tidy)
        shapes, count = done.drawing.scene, len(done.drawing.scene)
        shapes = replace(
            shapes,
            layer=np.full(count, pen, np.int32),
            colors=np.repeat(traced.pens[pen][None], count, axis=0),
            opacities=np.ones(count, np.float32),
        )
        scene, per_pixel = scene.append(shapes), max(per_pixel, done.per_pixel)
    return Filled(scene, per_pixel)
