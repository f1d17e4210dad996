"""Drawings, traced, fitted and tidied."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from functools import partial
from typing import Any

from warpsplat.drawing.byte_limit import Sketch, best_within
from warpsplat.drawing.chroma import finish_by_lightness
from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.draft import (
    as_fit,
    byte_price,
    draw_pixels,
    enlargement,
    glyphs_of,
    limited,
    original,
    trace_in_time,
)
from warpsplat.drawing.glyph_sheet import Sheet
from warpsplat.drawing.thin import THIN_SIDE, best_of_thin, continued, cut, margins
from warpsplat.drawing.tidy import LEAST_ERROR, Finished
from warpsplat.errors import counted
from warpsplat.fit.export import finished
from warpsplat.fit.palette import solid_shapes
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Settings
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.geometry import enlarged

SECONDS_PER_TRACED = 4e-6
"""Rough time of tracing a pixel on one core [s]."""

SECONDS_PER_NODE, SECONDS_PER_PIXEL = 5.5e-4, 1.5e-6
"""Rough time of fitting a trace on one core [s]."""

SECONDS_PER_WRITTEN = 6e-5
"""Rough time of writing a node [s]."""

LONG = 4.0
"""Time from which on it is announced [s]."""

log = logging.getLogger(__name__)


def draw_regions(problem: Problem, run: Run) -> Fit:
    """Trace an image as flat regions and gradients, within ``max_bytes`` by fewer regions or nodes."""
    settings, limit = problem.settings, problem.settings.max_bytes
    most = None if settings.simplify else settings.curves
    announce_trace(problem)
    sheet, rest = glyphs_of(problem)
    if sheet:
        return _drawn_with_sheet(problem, run, sheet, rest)
    traced = trace_regions(problem, run, most)
    if not run.over():
        announce_fit(len(traced.joints) // 3, problem)
    run = run.derived(deadline=run.deadline - SECONDS_PER_WRITTEN * len(traced.joints) / 3)
    parts = run.open_parts(share=0.5 if limit else 1.0)
    finish = partial(_finish, settings, original(problem.target))

    def sketch_of(done: Finished, most: int | None) -> Sketch:
        sketch = _sketch(problem, run, done)
        best = _best_if_thin(problem, next(parts), sketch.fit, most)
        return sketch if best is sketch.fit else Sketch(best, _size(best, settings), None)

    def fewer(count: int) -> Sketch:
        return sketch_of(finish(trace_regions(problem, run, count), next(parts)), count)

    def simpler(drawing: Drawing, price: float) -> Sketch:
        return _sketch(
            problem, run, finish(drawing, next(parts), tidy=True, price=price * byte_price(settings))
        )

    first = sketch_of(finish(traced, next(parts)), most)
    if not limit or first.size <= limit:
        return first.fit
    return replace(best_within(first, limit, fewer, simpler, run.over), interrupted=run.stopped())


def _finish(settings: Settings, target: FloatArray, drawing: Drawing, run: Run, **options: Any) -> Finished:
    """Finish a drawing as ``finish_by_lightness``, as the settings say where ``options`` do not."""
    usual = {
        "finest": finest(settings),
        "tidy": settings.tidy,
        "price": byte_price(settings),
        "symbols": settings.symbols,
    }
    return finish_by_lightness(target, drawing, run, **(usual | options))


def _drawn_with_sheet(problem: Problem, run: Run, sheet: Sheet, rest: FloatArray) -> Fit:
    """Draw the glyphs of an image, and the rest of it, on the grid that is right for what has most nodes."""
    settings, found = problem.settings, sheet.trace()
    copies = len(sheet.copies) / len(sheet.corners)
    parts = [
        (Drawing(found.scene, found.joints), sheet.image, copies),
        (trace_regions(replace(problem, target=rest), run, None), rest, 1.0),
    ]
    nodes = [len(drawing.joints) / 3 * times for drawing, _, times in parts]
    if not run.over():
        announce_fit(sum(len(drawing.joints) for drawing, *_ in parts) // 3, problem)
    run = run.derived(deadline=run.deadline - SECONDS_PER_WRITTEN * sum(nodes))
    scenes: list[Scene] = []
    grid, runs = None, run.open_parts()
    glyphs_first = nodes[0] >= nodes[1]
    for drawing, image, times in parts if glyphs_first else parts[::-1]:
        # What does not count in all of the image, in pixels of this part.
        negligible = LEAST_ERROR * max(rest[..., 0].size / (times * image[..., 0].size), 1.0)
        done = _finish(settings, image, drawing, next(runs), grid=grid, negligible=negligible)
        grid = done.per_pixel
        scenes.append(done.drawing.scene)
    glyphs, others = scenes if glyphs_first else scenes[::-1]
    scene, per_pixel = _whole(sheet.placed(glyphs, others), done.per_pixel, problem, run)
    return Fit(scene, per_pixel, math.nan, math.nan, 0, run.stopped())


def announce_trace(problem: Problem) -> None:
    """Say so if the trace of an image will take long."""
    pixels = original(problem.target)[..., 0].size
    _announce(problem, f"tracing its {pixels / 1e6:.1f} megapixels", SECONDS_PER_TRACED * pixels)


def announce_fit(nodes: int, problem: Problem) -> None:
    """Say so if the fit of a drawing with so many traced nodes will take long."""
    width, height = problem.size
    seconds = SECONDS_PER_NODE * nodes + SECONDS_PER_PIXEL * width * height
    _announce(problem, f"fitting its {counted(nodes, 'node')}", seconds)


def _announce(problem: Problem, work: str, seconds: float) -> None:
    """Say so if work will take long and has no time limit, and what makes it shorter."""
    if seconds > LONG and problem.settings.time_budget is None:
        how = "--time-budget or --quality draft make it shorter"
        log.warning("%s takes about %.0f s; %s", work, seconds, how)


def _best_if_thin(problem: Problem, run: Run, made: Fit, most: int | None) -> Fit:
    """Return the drawing or, for an image of few rows or columns, a better one if there is one."""
    across, down = margins(problem.target, THIN_SIDE)
    if not (across or down):
        return made
    others = [lambda: _drawn_beyond(problem, run, most)]
    return best_of_thin(made, others if most is not None else [*others, lambda: draw_pixels(problem, run)])


def _drawn_beyond(problem: Problem, run: Run, most: int | None) -> Fit:
    """Draw the image continued beyond its borders, and cut the drawing."""
    across, down = margins(problem.target, THIN_SIDE)
    wide = replace(problem, target=continued(problem.target, across, down))
    drawing = trace_regions(wide, run, most)
    done = _finish(problem.settings, original(wide.target), drawing, run, symbols=False)
    made = _sketch(wide, run, done).fit
    return as_fit(cut(made.scene, across, down), made.per_pixel, problem, run)


def trace_regions(problem: Problem, run: Run, most: int | None) -> Drawing:
    """Trace an image as it was before it was enlarged, in the colours that are allowed.

    ``most``: regions.
    """
    settings = problem.settings
    traced = trace_in_time(original(problem.target), most, settings, run)
    drawing = Drawing(traced.scene, traced.joints)
    if settings.is_limited:
        drawing = drawing.take(solid_shapes(drawing.scene))
        drawing = replace(drawing, scene=limited(drawing.scene, settings))
    return drawing


def _sketch(problem: Problem, run: Run, done: Finished) -> Sketch:
    """Return a finished drawing at the size of the whole image."""
    scene, per_pixel = _whole(done.drawing.scene, done.per_pixel, problem, run)
    if problem.settings.max_bytes or any(margins(problem.target, THIN_SIDE)) or math.isnan(done.psnr):
        made = as_fit(scene, per_pixel, problem, run)
    else:  # nothing to compare it with
        made = Fit(scene, per_pixel, done.psnr, done.psnr, 0, run.stopped())
    return Sketch(made, _size(made, problem.settings), done.drawing)


def _whole(scene: Scene, per_pixel: float, problem: Problem, run: Run) -> tuple[Scene, float]:
    """Return a scene of the image before it was enlarged, and its grid, at the size of the image."""
    size = enlargement(problem.target)
    scene = enlarged(scene, size, *problem.size)
    if problem.settings.strokes and not run.over():
        from warpsplat.drawing.pen import with_strokes

        scene = with_strokes(scene, problem.settings, run)
    return scene, per_pixel / size


def _size(made: Fit, settings: Settings) -> int:
    """Return the bytes of the file; 0 where they are not limited, and do not count."""
    return len(finished(made.scene, settings, made.per_pixel).encode()) if settings.max_bytes else 0
