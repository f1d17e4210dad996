"""Traces of drawings and of pixel art, within the run's time."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.drawing.trace.grids import unchecked
from warpsplat.drawing.trace.pixels import trace_pixels
from warpsplat.drawing.trace.trace import Traced, trace
from warpsplat.errors import Stopped
from warpsplat.fit.export import finished
from warpsplat.fit.palette import Palette, solid_shapes
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.settings import Painting, Settings, solid_color
from warpsplat.metrics import psnr_of_file
from warpsplat.portable import elementary
from warpsplat.portable.filters import boxed
from warpsplat.scene import FloatArray, Paint, Scene
from warpsplat.scene.attributes import GRADIENTS
from warpsplat.scene.geometry import enlarged

TRACE_SHARE = 0.75
"""Share of the time left that a trace may take before one of fewer pixels begins."""

QUICK_PIXELS = 131_072
"""Pixels of the coarsest trace, which always ends."""

DEAREST = 64.0
"""Price of a byte over its usual one with the least detail; with the most it is one over that."""


DRAWN_GRADIENTS: dict[Painting, tuple[Paint, ...]] = {
    "flat": (),
    "linear": (Paint.LINEAR,),
    "radial": (Paint.RADIAL,),
    "auto": GRADIENTS,
}
"""Kinds of gradients that a drawing may have, where they are worth their bytes, by ``paint``."""


def byte_price(settings: Settings) -> float:
    """Return the price of a byte over its usual one that ``detail`` stands for: 1 for a half."""
    return float(elementary.exp((1 - 2 * settings.detail) * elementary.log(DEAREST)))


def trace_in_time(
    image: FloatArray, noise: float | None, most: int | None, price: float, settings: Settings, run: Run
) -> Traced:
    """Trace an image, at a lower resolution if the run's time is too short or the run is stopped.

    ``noise``, ``most`` and ``price``: as for ``trace``.
    """
    height, width = image.shape[:2]

    def traced(factor: int, check: Callable[[], None]) -> Traced:
        small = boxed(image, factor) if factor > 1 else image
        gradients = DRAWN_GRADIENTS[settings.paint or "auto"]
        found = trace(
            small,
            most=most,
            price=price,
            check=check,
            gradients=gradients,
            noise=noise,
            removal=settings.removal,
        )
        return replace(found, scene=enlarged(found.scene, factor, width, height))

    least = math.ceil(np.sqrt(height * width / QUICK_PIXELS))
    for factor in range(1, min(least, 3)):
        with contextlib.suppress(Stopped):
            return traced(factor, run.within(TRACE_SHARE).check)
    return traced(least, unchecked)


def draw_pixels(problem: Problem, run: Run) -> Fit:
    """Trace pixel art, a shape for each area of cells of one colour."""
    settings = problem.settings
    scene, per_pixel = trace_pixels(problem.target, solid_color(settings.background), settings.removal)
    scene = limited(scene, settings)
    return replace(as_fit(scene, per_pixel, problem, run), interrupted=False)


def as_fit(scene: Scene, per_pixel: float, problem: Problem, run: Run) -> Fit:
    """Return a traced scene as a fit: its PSNR is that of its file."""
    figure = psnr_of_file(finished(scene, problem.settings, per_pixel), problem.target)
    return Fit(scene, per_pixel, figure, figure, 0, run.stopped())


def limited(scene: Scene, settings: Settings) -> Scene:
    """Return ``scene`` in the colours that the settings allow, but for a background that is left out."""
    if not settings.is_limited:
        return scene
    scene = scene.take(solid_shapes(scene))
    palette = Palette.of_scene(settings, scene)
    made = palette.limited(scene) if palette else scene
    return replace(made, canvas=scene.canvas) if settings.removal or settings.bridges else made
