"""Drawings, traced and, unless they are drafts, fitted and tidied."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from warpsplat.drawing.byte_limit import Sketch, best_within
from warpsplat.drawing.constraints import DRAFT_GRID, Drawing, Finished
from warpsplat.drawing.draft import as_fit, byte_price, draw_pixels, limited, trace_in_time
from warpsplat.drawing.glyph_sheet import Sheet
from warpsplat.drawing.glyphs import find_glyphs
from warpsplat.drawing.optics import without_optics
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.prices import LEAST_ERROR
from warpsplat.drawing.thin import THIN_SIDE, best_of_thin, continued, cut, margins
from warpsplat.errors import counted
from warpsplat.fit.export import finished, shown_image
from warpsplat.fit.palette import solid_shapes
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Settings
from warpsplat.portable import elementary
from warpsplat.scene import FloatArray, Scene

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
    """Trace an image as flat regions and gradients, within ``max_bytes`` by fewer regions or nodes.

    A draft, which is not tidied, is the trace, and needs no Warp.
    """
    settings, limit = problem.settings, problem.settings.max_bytes
    most = None if settings.simplify else settings.curves
    picture = Picture.of(problem.target)
    announce_trace(picture, settings)
    picture, found = _sharp(picture, settings, run, most)
    if found.sheet:
        made = _drawn_with_sheet(picture, settings, run, found)
        if not limit or _size(made, settings) <= limit:
            return made
        found = _traced(picture.pixels, picture.noise, settings, run, most, has_sheet=False)
    traced = found.drawing
    if not run.over():
        announce_fit(len(traced.joints) // 3, picture, settings)
    run = run.derived(deadline=run.deadline - SECONDS_PER_WRITTEN * len(traced.joints) / 3)
    parts = run.open_parts(share=0.5 if limit else 1.0)
    negligible = LEAST_ERROR * picture.drawn_share
    finish = partial(_finish, settings, picture.pixels, negligible=negligible, seen=picture.seen)

    def sketch_of(done: Finished, most: int | None) -> Sketch:
        sketch = _sketch(problem, picture, run, done)
        best = _best_if_thin(problem, picture, next(parts), sketch.fit, most)
        return sketch if best is sketch.fit else Sketch(best, _size(best, settings), None)

    def fewer(count: int) -> Sketch:
        return sketch_of(
            finish(trace_regions(picture.pixels, picture.noise, settings, run, count), next(parts)), count
        )

    def simpler(drawing: Drawing, price: float) -> Sketch:
        done = finish(drawing, next(parts), price=price * byte_price(settings))
        return _sketch(problem, picture, run, done)

    first = sketch_of(finish(traced, next(parts)), most)
    if not limit or first.size <= limit:
        return first.fit
    return replace(best_within(first, limit, fewer, simpler, run.over), interrupted=run.stopped())


@dataclass(frozen=True)
class _Trace:
    """A traced picture: its glyphs, and the rest of it."""

    drawing: Drawing
    """Of the rest."""
    rest: FloatArray
    """The picture without glyphs."""
    scene: Scene
    """All of it."""
    sheet: Sheet | None = None
    glyphs: Drawing | None = None


def _traced(
    pixels: FloatArray,
    noise: float | None,
    settings: Settings,
    run: Run,
    most: int | None,
    *,
    has_sheet: bool = True,
) -> _Trace:
    """Trace an image; its glyphs on a sheet, if it has some and may have (``has_sheet``)."""
    sheet, rest = find_glyphs(pixels) if has_sheet else (None, pixels)
    if sheet:
        glyphs, others = sheet.trace(), trace_regions(rest, noise, settings, run, None)
        scene = sheet.placed(glyphs.scene, others.scene)
        if most is None or len(scene) <= most:
            return _Trace(others, rest, scene, sheet, Drawing(glyphs.scene, glyphs.joints))
    drawing = trace_regions(pixels, noise, settings, run, most)
    return _Trace(drawing, pixels, drawing.scene)


def _sharp(picture: Picture, settings: Settings, run: Run, most: int | None) -> tuple[Picture, _Trace]:
    """Return a picture as it was before it was blurred or sharpened, and its trace."""
    has_sheet = not any(margins(picture.pixels, THIN_SIDE))

    def trace(pixels: FloatArray) -> _Trace:
        return _traced(pixels, picture.noise, settings, run, most, has_sheet=has_sheet)

    def show(found: _Trace) -> FloatArray:
        text = finished(found.scene, settings, DRAFT_GRID)
        return shown_image(text, found.scene, picture.pixels.shape[2])

    pixels, found = without_optics(picture.pixels, trace, show, run.over)
    seen = None if pixels is picture.pixels else picture.pixels
    return replace(picture, pixels=pixels, seen=seen), found


def _finish(settings: Settings, target: FloatArray, drawing: Drawing, run: Run, **options: Any) -> Finished:
    """Finish a drawing as ``finish_by_lightness``, as the settings say where ``options`` do not.

    A draft stays as it is.
    """
    if not settings.tidy:
        return Finished(drawing, min(DRAFT_GRID, finest(settings)))
    from warpsplat.drawing.chroma import finish_by_lightness

    usual = {"finest": finest(settings), "price": byte_price(settings), "symbols": settings.symbols}
    return finish_by_lightness(target, drawing, run, **(usual | options))


def _drawn_with_sheet(picture: Picture, settings: Settings, run: Run, found: _Trace) -> Fit:
    """Draw the glyphs of an image, and the rest of it, on the grid that is right for what has most nodes."""
    sheet, glyphs, others, rest = found.sheet, found.glyphs, found.drawing, found.rest
    assert sheet and glyphs
    copies = len(sheet.copies) / len(sheet.corners)
    parts = [(glyphs, sheet.image, copies), (others, rest, 1.0)]
    nodes = [len(drawing.joints) / 3 * times for drawing, _, times in parts]
    if not run.over():
        announce_fit(sum(len(drawing.joints) for drawing, *_ in parts) // 3, picture, settings)
    run = run.derived(deadline=run.deadline - SECONDS_PER_WRITTEN * sum(nodes))
    scenes: list[Scene] = []
    grid, runs = None, run.open_parts()
    glyphs_first = nodes[0] >= nodes[1]
    for drawing, image, times in parts if glyphs_first else parts[::-1]:
        # What does not count in all of the image, in pixels of this part.
        share = picture.drawn_share * rest[..., 0].size / (times * image[..., 0].size)
        negligible = LEAST_ERROR * max(share, picture.drawn_share)
        done = _finish(settings, image, drawing, next(runs), grid=grid, negligible=negligible)
        grid = done.per_pixel
        scenes.append(done.drawing.scene)
    scene = sheet.placed(*(scenes if glyphs_first else scenes[::-1]))
    if settings.is_limited:
        scene = limited(scene.take(solid_shapes(scene)), settings)
    scene, per_pixel = _whole(scene, done.per_pixel, picture, settings, run)
    return Fit(scene, per_pixel, math.nan, math.nan, 0, run.stopped())


def announce_trace(picture: Picture, settings: Settings) -> None:
    """Say so if the trace of a picture will take long."""
    pixels = picture.pixels[..., 0].size
    _announce(settings, f"tracing its {pixels / 1e6:.1f} megapixels", SECONDS_PER_TRACED * pixels)


def announce_fit(nodes: int, picture: Picture, settings: Settings) -> None:
    """Say so if the fit of a drawing with so many traced nodes will take long."""
    seconds = SECONDS_PER_NODE * nodes + SECONDS_PER_PIXEL * picture.pixels[..., 0].size
    _announce(settings, f"fitting its {counted(nodes, 'node')}", seconds)


def _announce(settings: Settings, work: str, seconds: float) -> None:
    """Say so if work will take long and has no time limit, and what makes it shorter."""
    if seconds > LONG and settings.time_budget is None and settings.tidy:
        how = "--time-budget or --quality draft make it shorter"
        log.warning("%s takes about %.0f s; %s", work, seconds, how)


def _best_if_thin(problem: Problem, picture: Picture, run: Run, made: Fit, most: int | None) -> Fit:
    """Return the drawing or, for an image of few rows or columns, a better one if there is one."""
    across, down = margins(picture.pixels, THIN_SIDE)
    if not (across or down):
        return made
    others = [lambda: _drawn_beyond(problem, picture, run, most)]
    return best_of_thin(made, others if most is not None else [*others, lambda: draw_pixels(problem, run)])


def _drawn_beyond(problem: Problem, picture: Picture, run: Run, most: int | None) -> Fit:
    """Draw the picture continued beyond its borders, and cut the drawing."""
    across, down = margins(picture.pixels, THIN_SIDE)
    wide, settings = continued(picture.pixels, across, down), problem.settings
    drawing = trace_regions(wide, picture.noise, settings, run, most)
    done = _finish(settings, wide, drawing, run, symbols=False)
    scene = cut(done.drawing.scene, across, down)
    return as_fit(*_whole(scene, done.per_pixel, picture, settings, run), problem, run)


def trace_regions(
    image: FloatArray, noise: float | None, settings: Settings, run: Run, most: int | None
) -> Drawing:
    """Trace an image, in the colours that are allowed. ``noise`` and ``most``: as for ``trace``."""
    traced = trace_in_time(image, noise, most, settings, run)
    drawing = Drawing(traced.scene, traced.joints)
    if settings.is_limited:
        drawing = drawing.take(solid_shapes(drawing.scene))
        drawing = replace(drawing, scene=limited(drawing.scene, settings))
    return drawing


def _sketch(problem: Problem, picture: Picture, run: Run, done: Finished) -> Sketch:
    """Return a finished drawing at the size of the whole image."""
    scene, per_pixel = _whole(done.drawing.scene, done.per_pixel, picture, problem.settings, run)
    settings, is_known = problem.settings, not math.isnan(done.psnr)
    is_compared = settings.max_bytes or any(margins(picture.pixels, THIN_SIDE))
    if is_compared or (settings.tidy and not is_known):
        made = as_fit(scene, per_pixel, problem, run)
    else:  # nothing to compare it with
        psnr = done.psnr - 10 * float(elementary.log10(picture.share))
        made = Fit(scene, per_pixel, psnr, psnr, 0, run.stopped())
    return Sketch(made, _size(made, settings), done.drawing if settings.tidy else None)


def _whole(
    scene: Scene, per_pixel: float, picture: Picture, settings: Settings, run: Run
) -> tuple[Scene, float]:
    """Return a scene of a picture, and its grid, at the size of the image."""
    scene = picture.placed(scene)
    if settings.strokes and settings.tidy and not run.over():
        from warpsplat.drawing.pen import with_strokes

        scene = with_strokes(scene, settings, run)
    return scene, per_pixel / picture.enlargement


def _size(made: Fit, settings: Settings) -> int:
    """Return the bytes of the file; 0 where they are not limited, and do not count."""
    return len(finished(made.scene, settings, made.per_pixel).encode()) if settings.max_bytes else 0
