"""What an image shows decides how it is vectorized: a photograph by fitting shapes, all else by tracing."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.drawing.byte_limit import Sketch, Tries, best_within
from warpsplat.drawing.fit_outlines import Refinement, matching
from warpsplat.drawing.line_art import draw_lines
from warpsplat.drawing.thin import THIN, THINNEST, best_of_thin, continued, cut, margins
from warpsplat.drawing.tidy import REFIT, finish_drawing
from warpsplat.drawing.trace.pixels import cell_size, trace_pixels
from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.constraints import Drawing
from warpsplat.fit.export import finished
from warpsplat.fit.loop import Fit
from warpsplat.fit.palette import Palette, solid_shapes
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.fit.stages import Stages
from warpsplat.fit.work import Report
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.geometry import enlarged

Stop = Callable[[], bool]


def decided(target: FloatArray, settings: Settings) -> tuple[Settings, str]:
    """``settings`` with a subject, and why it is that; the reason is empty where it was given.

    What only a fit can do makes a photograph of any image: strokes, levels, a goal. Line art may
    be mixed.
    """
    if settings.subject != "auto":
        return settings, ""
    # Of a size, drawings know as well: with fewer regions.
    fitted = settings.unsuited("drawing")
    guess = guess_subject(target) if fitted in ([], ["mixed"]) else None
    if guess is None or (fitted and guess.subject != "line"):
        return replace(settings, subject="photo"), f"{fitted[0]} is for fitted shapes"
    if settings.max_bytes and guess.subject not in {"photo", "drawing"}:
        return replace(settings, subject="photo"), "max-bytes is for fitted shapes and drawings"
    return replace(settings, subject=guess.subject), guess.why


def draw(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    seconds: float | None = None,
    report: Report | None = None,
    after: float = 0.0,
    stop: Stop | None = None,
    stages: Stages | None = None,
) -> Fit:
    """Trace ``target`` as its ``settings.subject`` asks for; arguments are those of ``fit``, and the work
    that comes ``after`` it (``fit.costs``).
    """
    deadline = math.inf if seconds is None else time.monotonic() + seconds

    def over() -> bool:
        return time.monotonic() > deadline or bool(stop and stop())

    if settings.subject == "pixel":
        return _cells(target, settings, backend)
    if settings.subject == "line":
        across, down = margins(target, THINNEST)
        if across or down:
            made = draw_lines(continued(target, across, down), settings, backend, seconds=seconds, stop=stop)
            return replace(made, scene=cut(made.scene, across, down))
        return draw_lines(
            target, settings, backend, seconds=seconds, report=report, after=after, stop=stop, stages=stages
        )
    most = None if settings.simplify else settings.curves
    tries = Tries(report, settings.max_bytes) if settings.max_bytes else None

    across, down = margins(target, THIN)

    def finished_again(drawing: Drawing, price: float) -> Sketch:
        told = tries.begun(drawing.scene) if tries else report
        return _finished(target, settings, backend, drawing, price, over, stop, told, after)

    def drawn(most: int | None) -> Sketch:
        first = finished_again(_traced(target, settings, most), 1.0)
        if not (across or down):
            return first
        ways = [lambda: first.fit, lambda: _drawn_beyond(target, settings, backend, most, over, stop)]
        ways += [lambda: _cells(target, settings, backend)] if most is None else []
        best = best_of_thin(ways)
        return Sketch(best, _size(best, settings), None)

    first = drawn(most)
    if not settings.max_bytes or first.size <= settings.max_bytes:
        return first.fit
    made = best_within(first, settings.max_bytes, drawn, finished_again, over, tries)
    return replace(made, interrupted=bool(stop and stop()))


def _cells(target: FloatArray, settings: Settings, backend: Backend) -> Fit:
    """Pixel art."""
    scene, per_pixel = trace_pixels(target, solid_color(settings.background))
    if settings.is_limited:
        scene = limited(scene.take(solid_shapes(scene)), settings)
    return _made(scene, per_pixel, target, backend, interrupted=False)


def _drawn_beyond(
    target: FloatArray, settings: Settings, backend: Backend, most: int | None, over: Stop, stop: Stop | None
) -> Fit:
    """A drawing of ``most`` regions of the picture continued beyond its borders."""
    across, down = margins(target, THIN)
    wide = continued(target, across, down)
    drawing = _traced(wide, settings, most)
    made = _finished(wide, settings, backend, drawing, 1.0, over, stop, None, 0.0).fit
    scene = cut(made.scene, across, down)
    return _made(scene, made.per_pixel, target, backend, interrupted=made.interrupted)


def _size(made: Fit, settings: Settings) -> int:
    """Bytes of the file."""
    return len(finished(made.scene, settings, made.per_pixel).encode())


def _traced(target: FloatArray, settings: Settings, most: int | None) -> Drawing:
    """A drawing of ``most`` regions."""
    traced = trace(_small(target), most=most)
    drawing = Drawing(traced.scene, traced.joints, traced.same)
    if settings.is_limited:
        drawing = drawing.take(solid_shapes(drawing.scene))
        drawing = replace(drawing, scene=limited(drawing.scene, settings))
    return drawing


def _small(target: FloatArray) -> FloatArray:
    """A picture before it was enlarged."""
    size = enlargement(target)
    return np.ascontiguousarray(target[::size, ::size])


def _finished(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    drawing: Drawing,
    price: float,
    over: Stop,
    stop: Stop | None,
    report: Report | None,
    after: float,
) -> Sketch:
    """A drawing finished. ``price``: of a byte (``drawing.tidy``)."""
    size, whole = enlargement(target), (target.shape[1], target.shape[0])
    done = finish_drawing(
        _small(target),
        drawing,
        backend,
        Refinement() if price == 1 else REFIT,
        finest=finest(settings),
        tidy=settings.tidy or price > 1,
        price=price,
        report=report,
        after=after,
        stop=over,
    )
    scene, per_pixel = enlarged(done.drawing.scene, size, *whole), done.per_pixel / size
    made = _made(scene, per_pixel, target, backend, interrupted=bool(stop and stop()))
    return Sketch(made, _size(made, settings), done.drawing)


LEAST_SIDE = 96
"""Of a picture that an enlarged one is reduced to [px]: what is smaller says little of outlines."""


def enlargement(image: FloatArray) -> int:
    """How many times an image was enlarged by repeating its pixels: its antialiasing is that of the smaller
    one, and the steps of its pixels are no part of what it shows.
    """
    size, side = cell_size(image), min(image.shape[:2])
    fits = (n for n in range(1, size + 1) if size % n == 0 and side >= n * LEAST_SIDE)
    return max(fits, default=1)


def limited(scene: Scene, settings: Settings) -> Scene:
    """``scene`` in the colours that the settings allow."""
    palette = Palette.of_scene(settings, scene)
    return palette.limited(scene) if palette else scene


def _made(scene: Scene, per_pixel: float, target: FloatArray, backend: Backend, *, interrupted: bool) -> Fit:
    """With the figure of the render, for want of a training's."""
    shown = psnr(255 * render(scene, backend=backend), 255 * matching(target, scene.canvas))
    return Fit(scene, per_pixel, shown, shown, 0, interrupted)
