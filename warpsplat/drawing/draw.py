"""Drawings, traced and, unless they are drafts, fitted and tidied."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpsplat.drawing.constraints import DRAFT_GRID, Drawing, Finished
from warpsplat.drawing.draft import as_fit, byte_price, draw_pixels, limited, trace_in_time
from warpsplat.drawing.glyph_sheet import GlyphSheet
from warpsplat.drawing.glyphs import find_glyphs
from warpsplat.drawing.illumination import find_illumination, relative
from warpsplat.drawing.optics import NONE, SCALE
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.prices import LEAST_ERROR
from warpsplat.drawing.thin import TRACED_PSNR
from warpsplat.drawing.trace.regions import smoothed
from warpsplat.drawing.without_optics import CLEARLY, cost_of, without_optics
from warpsplat.errors import counted
from warpsplat.fit.export import finished, shown_image
from warpsplat.fit.optics import Optics
from warpsplat.fit.palette import solid_shapes
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Settings
from warpsplat.portable import elementary
from warpsplat.scene import FloatArray, Kind, Scene
from warpsplat.scene.simple import simple
from warpsplat.svg.write import rounded

SECONDS_PER_PIXEL, SECONDS_PER_NODE = 4e-6, 5.5e-4
"""Rough time of tracing a pixel, and of fitting a node, on one core [s]."""

SECONDS_PER_WRITTEN = 6e-5
"""Rough time of writing a node [s]."""

LONG = 4.0
"""Time from which on it is announced [s]."""

GRADIENT_BYTES = 200
"""Rough size in a file of a gradient that describes the ground as well as its light does."""

DEARER, TRIES = 8.0, 9
"""The factor from one price of a byte to the next, and how many are tried, to draw within a size."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Trace:
    """A traced picture: its glyphs, and the rest of it."""

    drawing: Drawing
    """The trace of the rest."""
    rest: FloatArray
    """The picture without glyphs."""
    scene: Scene
    """All of it."""
    sheet: GlyphSheet | None = None
    glyphs: Drawing | None = None


def draw_regions(problem: Problem, run: Run) -> Fit:
    """Trace an image as flat regions and gradients; within ``max_bytes`` at a higher price of a byte.

    A draft, which is not tidied, is the trace, and needs no Warp.
    """
    settings, limit = problem.settings, problem.settings.max_bytes
    if settings.tidy:
        from warpsplat.drawing.kernels import compile_meanwhile

        compile_meanwhile(Kind.FILL, run.backend)
    most = None if settings.simplify else settings.curves
    known = Optics.of(settings.optics)
    is_soft = settings.optics == "none" or known.kernel is not None
    picture = Picture.of(problem.target, is_soft=is_soft, illumination=known.illumination)
    price = byte_price(settings)
    announce_trace(picture, settings)
    if not (is_soft or known.illumination):
        picture = _in_even_light(picture, problem.target, settings, run, most)
    picture, found = _sharp(picture, settings, run, most)
    if not run.over():
        announce_fit(sum(len(part.joints) for part in (found.drawing, found.glyphs) if part) // 3, settings)
    run = run.derived(deadline=run.deadline - SECONDS_PER_WRITTEN * len(found.scene.points) / 3)
    parts = run.open_parts(share=0.5 if limit else 1.0)

    def drawn(found: _Trace, price: float) -> Fit:
        made = _drawn(picture, found, settings, next(parts), price)
        if picture.is_thin and most is None:
            made = as_fit(made.scene, made.per_pixel, problem, run)
            if made.render_psnr < TRACED_PSNR:
                made = max(draw_pixels(problem, run), made, key=lambda each: each.render_psnr)
        return made

    def again(price: float) -> Fit:
        return drawn(_traced(picture, settings, run, most, price, has_sheet=False), price)

    def size(made: Fit) -> int:
        return len(finished(made.scene, settings, made.per_pixel).encode())

    first = drawn(found, price)
    if not limit or size(first) <= limit:
        return first
    return replace(within(limit, first, again, size, price, run.over), interrupted=run.stopped())


def within(
    most: int,
    first: Fit,
    draw: Callable[[float], Fit],
    size: Callable[[Fit], int],
    price: float,
    over: Callable[[], bool],
) -> Fit:
    """Return a drawing within ``most`` bytes at the least price of a byte, or a small one if none fits.

    Args:
        most: Bytes.
        first: The drawing at ``price``, which is too large.
        draw: Draws at a price.
        size: Returns the bytes of a drawing's file.
        price: Of a byte, over its usual one.
        over: Returns whether to take the best so far.
    """
    best, low, high = first, price, math.inf
    for _ in range(TRIES):
        if over():
            break
        price = math.sqrt(low * high) if high < math.inf else DEARER * low
        made = draw(price)
        if size(made) <= most:
            best, high = made, price
        else:
            best, low = made if high == math.inf else best, price
    return best


def _traced(
    picture: Picture, settings: Settings, run: Run, most: int | None, price: float, *, has_sheet: bool = True
) -> _Trace:
    """Trace a picture; its glyphs on a sheet, if it has some and may have (``has_sheet``)."""

    def trace(pixels: FloatArray, most: int | None) -> Drawing:
        if picture.is_halved and picture.noise:  # told before colours were made sharp, as less is seen after
            pixels = smoothed(pixels * np.float32(255), picture.noise) / np.float32(255)
        traced = trace_in_time(pixels, picture.noise, most, price, settings, run)
        drawing = Drawing(traced.scene, traced.joints)
        if settings.is_limited:
            drawing = drawing.take(solid_shapes(drawing.scene))
        return replace(drawing, scene=limited(drawing.scene, settings))

    # On a sheet without its ground, holes are empty.
    has_sheet = has_sheet and settings.removal != "outside"
    sheet, rest = None, picture.pixels
    if has_sheet:
        sheet, rest = find_glyphs(picture.pixels, removes_ground=settings.removal is not None)
    if sheet:
        glyphs, others = sheet.trace(settings.removal), trace(rest, None)
        scene = sheet.placed(glyphs.scene, others.scene)
        if most is None or len(scene) <= most:
            return _Trace(others, rest, scene, sheet, Drawing(glyphs.scene, glyphs.joints))
    drawing = trace(picture.pixels, most)
    return _Trace(drawing, picture.pixels, drawing.scene)


def _in_even_light(
    picture: Picture, target: FloatArray, settings: Settings, run: Run, most: int | None
) -> Picture:
    """Return the picture of an image in even light, if its trace explains the image better so.

    More of it in fewer bytes, or clearly better for its bytes.
    """
    found = find_illumination(target)
    if found is None or run.over():
        return picture

    def look(picture: Picture) -> tuple[float, float]:
        """Return the squared error of a trace, and what this and its size cost [dB]."""
        # Neither apart nor smoothed: letters that no optics have made sharp yet would be far off in any case.
        rough = replace(picture, is_halved=False)
        traced = _traced(rough, settings, run, most, byte_price(settings), has_sheet=False)
        scene = picture.placed(traced.scene)
        shown = shown_image(finished(scene, settings, DRAFT_GRID), scene, target.shape[2])
        if picture.illumination:
            shown = shown * relative(picture.illumination, target)
        error = float(np.square((shown - target) * 255, dtype=np.float64).sum())
        return error, cost_of(error, scene, GRADIENT_BYTES if picture.illumination else 0)

    even = Picture.of(target, illumination=found)
    (error, cost), (usual_error, usual) = look(even), look(picture)
    clearly = usual + 10 * float(elementary.log10(CLEARLY))
    return even if cost < (usual if error < usual_error else clearly) else picture


def _sharp(picture: Picture, settings: Settings, run: Run, most: int | None) -> tuple[Picture, _Trace]:
    """Return a picture as it was before it was blurred or sharpened, if that may be undone, and its trace."""

    def trace(pixels: FloatArray) -> _Trace:
        return _traced(replace(picture, pixels=pixels), settings, run, most, byte_price(settings))

    def show(scene: Scene) -> FloatArray:
        return shown_image(finished(scene, settings, DRAFT_GRID / SCALE), scene, picture.pixels.shape[2])

    if settings.optics == "none":
        return picture, trace(picture.pixels)
    seen = picture.seen if picture.is_halved else None
    known = Optics.of(settings.optics)
    undone = without_optics(picture.pixels, picture.noise, trace, show, run.over, seen, known)
    if undone.optics is None:
        return picture, undone.traced
    seen = picture.pixels if seen is None else seen
    return replace(picture, pixels=undone.pixels, seen=seen, optics=undone.optics), undone.traced


def _drawn(picture: Picture, found: _Trace, settings: Settings, run: Run, price: float) -> Fit:
    """Finish a trace, the glyphs first, on whose grid is the rest then, at the size of the whole image."""
    usual = byte_price(settings)
    # What is not worth a region is not worth a node.
    negligible = LEAST_ERROR * picture.drawn_share * price / usual
    options: dict[str, Any] = {"negligible": negligible, "price": usual}
    if found.sheet and found.glyphs:
        runs = run.open_parts()
        glyphs = _finish(settings, found.sheet.image, found.glyphs, next(runs), **options)
        done = _finish(settings, found.rest, found.drawing, next(runs), grid=glyphs.per_pixel, **options)
        scene = limited(found.sheet.placed(glyphs.drawing.scene, done.drawing.scene), settings)
    else:
        # Halved colours alone have no kernel.
        options |= {"seen": picture.seen, "optics": picture.optics or Optics("sRGB", NONE)}
        done = _finish(settings, found.rest, found.drawing, run, **options)
        scene = done.drawing.scene
    scene = picture.placed(scene)
    if settings.strokes and settings.tidy and not run.over():
        from warpsplat.drawing.pen import with_strokes

        scene = with_strokes(scene, settings, run)
    psnr = done.psnr - 10 * float(elementary.log10(picture.share))
    grid = done.per_pixel / float(picture.enlargement.mean())
    scene = simple(rounded(scene, grid), grid)
    optics = picture.optics or (Optics() if picture.is_interpolated else None)
    if picture.illumination:
        optics = replace(optics or Optics("sRGB", NONE), illumination=picture.illumination)
    return Fit(scene, grid, psnr, psnr, 0, run.stopped(), optics=optics)


def _finish(settings: Settings, target: FloatArray, drawing: Drawing, run: Run, **options: Any) -> Finished:
    """Finish a drawing as ``finish_drawing``, with what the settings say beside ``options``.

    A draft stays as it is.
    """
    if not settings.tidy:
        return Finished(drawing, min(DRAFT_GRID, finest(settings)))
    from warpsplat.drawing.tidy import finish_drawing

    return finish_drawing(target, drawing, run, finest=finest(settings), symbols=settings.symbols, **options)


def announce_trace(picture: Picture, settings: Settings) -> None:
    """Say so if the trace of a picture will take long."""
    pixels = picture.pixels[..., 0].size
    _announce(settings, f"tracing its {pixels / 1e6:.1f} megapixels", SECONDS_PER_PIXEL * pixels)


def announce_fit(nodes: int, settings: Settings) -> None:
    """Say so if the fit of a drawing with so many traced nodes will take long."""
    _announce(settings, f"fitting its {counted(nodes, 'node')}", SECONDS_PER_NODE * nodes)


def _announce(settings: Settings, work: str, seconds: float) -> None:
    """Say so if work will take long and has no time limit, and what makes it shorter."""
    if seconds > LONG and settings.time_budget is None and settings.tidy:
        how = "--time-budget or --quality draft make it shorter"
        log.warning("%s takes about %.0f s; %s", work, seconds, how)
