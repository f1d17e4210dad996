"""Drawings and pixel art as they are traced: no fit, and no render but the viewer's."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.drawing.byte_limit import Sketch, best_within
from warpsplat.drawing.glyph_sheet import Sheet
from warpsplat.drawing.glyphs import find_glyphs
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.thin import THIN_SIDE, best_of_thin, continued, cut, margins
from warpsplat.drawing.trace.grids import unchecked
from warpsplat.drawing.trace.pixels import trace_pixels
from warpsplat.drawing.trace.trace import Traced, trace
from warpsplat.errors import Stopped
from warpsplat.fit.export import finished
from warpsplat.fit.palette import Palette, solid_shapes
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Painting, Settings, solid_color
from warpsplat.metrics import psnr_of_file
from warpsplat.portable import elementary
from warpsplat.portable.filters import boxed
from warpsplat.scene import FloatArray, Paint, Scene
from warpsplat.scene.attributes import GRADIENTS
from warpsplat.scene.geometry import enlarged

DRAFT_GRID = 8.0
"""View box units per pixel of a draft: a trace is no nearer to the image (docs/experiments.md)."""

TRACE_SHARE = 0.75
"""Share of the time left that a trace may take before one of fewer pixels begins."""

QUICK_PIXELS, QUICK_SECONDS = 131_072, 1.0
"""Pixels of the coarsest trace, which always ends, and the time that is kept for it [s]."""

DEAREST = 64.0
"""Price of a byte over its usual one with the least detail; with the most it is one over that."""


DRAWN_GRADIENTS: dict[Painting, tuple[Paint, ...]] = {
    "flat": (),
    "linear": (Paint.LINEAR,),
    "radial": (Paint.RADIAL,),
    "auto": GRADIENTS,
}
"""Kinds of gradients that a drawing may have, where they are worth their bytes, by ``paint``."""


def draft_regions(problem: Problem, run: Run) -> Fit:
    """Trace an image as flat regions and gradients, within ``max_bytes`` by fewer regions."""
    settings, picture = problem.settings, Picture.of(problem.target)

    def sketch(most: int | None, sheet: Sheet | None = None) -> Sketch:
        made = _best_if_thin(problem, picture, run, most, sheet, rest if sheet else picture.pixels)
        return Sketch(made, len(finished(made.scene, settings, made.per_pixel).encode()), None)

    def fits(made: Sketch) -> bool:
        return not settings.max_bytes or made.size <= settings.max_bytes

    sheet, rest = glyphs_of(picture.pixels)
    most, first = most_shapes(settings), sketch(None, sheet)
    is_few = most is None or len(first.fit.scene) <= most
    if is_few and fits(first):
        return first.fit
    if sheet or not is_few:
        first = sketch(most)
    if fits(first):
        return first.fit
    assert settings.max_bytes
    best = best_within(first, settings.max_bytes, sketch, lambda drawing, price: first, run.over)
    return replace(best, interrupted=run.stopped())


def byte_price(settings: Settings) -> float:
    """Return the price of a byte over its usual one that ``detail`` stands for: 1 for a half."""
    return float(elementary.exp((1 - 2 * settings.detail) * elementary.log(DEAREST)))


def most_shapes(settings: Settings) -> int | None:
    """Return how many paths a drawing may have; None: any number."""
    return None if settings.simplify else settings.curves


def _best_if_thin(
    problem: Problem, picture: Picture, run: Run, most: int | None, sheet: Sheet | None, image: FloatArray
) -> Fit:
    """Trace an image; one of few rows or columns also continued beyond its borders, or as cells.

    ``sheet``: letters that are drawn once; None: none. ``image``: the picture without them.
    """
    settings = problem.settings

    def traced(across: int = 0, down: int = 0) -> Fit:
        scene = trace_in_time(continued(image, across, down), picture.noise, most, settings, run).scene
        scene = sheet.placed(sheet.trace().scene, scene) if sheet else scene
        if settings.is_limited:
            scene = limited(scene.take(solid_shapes(scene)), settings)
        scene = picture.placed(cut(scene, across, down))
        per_pixel = min(DRAFT_GRID, finest(settings)) / picture.enlargement
        if settings.max_bytes or any(margin):
            return as_fit(scene, per_pixel, problem, run)
        return Fit(scene, per_pixel, math.nan, math.nan, 0, run.stopped())

    margin = margins(picture.pixels, THIN_SIDE)
    if not any(margin):
        return traced()
    others = [lambda: traced(*margin), lambda: draw_pixels(problem, run)]
    return best_of_thin(traced(), others[: 1 if most is not None else 2])


def glyphs_of(image: FloatArray) -> tuple[Sheet | None, FloatArray]:
    """Return the sheet of an image's glyphs, and the image without them; one of few rows has none."""
    return (None, image) if any(margins(image, THIN_SIDE)) else find_glyphs(image)


def trace_in_time(
    image: FloatArray, noise: float | None, most: int | None, settings: Settings, run: Run
) -> Traced:
    """Trace an image, at a lower resolution if the run's time is too short or the run is stopped.

    ``noise`` and ``most``: as for ``trace``.
    """
    height, width = image.shape[:2]

    def traced(factor: int, check: Callable[[], None]) -> Traced:
        small = boxed(image, factor) if factor > 1 else image
        price, gradients = byte_price(settings), DRAWN_GRADIENTS[settings.paint or "auto"]
        found = trace(small, most=most, price=price, check=check, gradients=gradients, noise=noise)
        return replace(found, scene=enlarged(found.scene, factor, width, height))

    least = math.ceil(np.sqrt(height * width / QUICK_PIXELS))
    early = run.derived(deadline=run.deadline - QUICK_SECONDS)
    for factor in range(1, min(least, 3)):
        with contextlib.suppress(Stopped):
            return traced(factor, early.within(TRACE_SHARE).check)
    return traced(least, unchecked)


def draw_pixels(problem: Problem, run: Run) -> Fit:
    """Trace pixel art, a shape for each area of cells of one colour."""
    scene, per_pixel = trace_pixels(problem.target, solid_color(problem.settings.background))
    if problem.settings.is_limited:
        scene = limited(scene.take(solid_shapes(scene)), problem.settings)
    return replace(as_fit(scene, per_pixel, problem, run), interrupted=False)


def as_fit(scene: Scene, per_pixel: float, problem: Problem, run: Run) -> Fit:
    """Return a traced scene as a fit: its PSNR is that of its file."""
    figure = psnr_of_file(finished(scene, problem.settings, per_pixel), problem.target)
    return Fit(scene, per_pixel, figure, figure, 0, run.stopped())


def limited(scene: Scene, settings: Settings) -> Scene:
    """Return ``scene`` in the colours that the settings allow."""
    palette = Palette.of_scene(settings, scene)
    return palette.limited(scene) if palette else scene
