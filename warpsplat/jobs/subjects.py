"""What an image shows decides how it is vectorized: a photograph by fitting shapes, all else by tracing."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.fit.constraints import Drawing
from warpsplat.fit.drawing import Refinement, matching
from warpsplat.fit.export import finished
from warpsplat.fit.loop import Fit
from warpsplat.fit.palette import Palette, solid_shapes
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.fit.stages import Stages
from warpsplat.fit.tidy import finish_drawing
from warpsplat.fit.work import Meter, Report
from warpsplat.jobs.line import draw_lines
from warpsplat.jobs.thin import THIN, THINNEST, best_of_thin, continued, cut, margins
from warpsplat.metrics import psnr
from warpsplat.portable.elementary import log2
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.geometry import enlarged
from warpsplat.svg.write import write_svg
from warpsplat.trace.pixels import cell_size, trace_pixels
from warpsplat.trace.subject import guess_subject
from warpsplat.trace.trace import trace

Stop = Callable[[], bool]


def decided(target: FloatArray, settings: Settings) -> tuple[Settings, str]:
    """``settings`` with a subject, and why it is that; the reason is empty where it was given.

    What only a fit can do makes a photograph of any image: strokes, levels, a goal. Line art may
    be mixed.
    """
    if settings.subject != "auto":
        return settings, ""
    # Of a size, drawings know as well: with fewer regions.
    fitted = replace(settings, max_bytes=None).fitted_options()
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

    def drawn(most: int | None) -> Fit:
        told = tries.begun if tries else lambda traced: report
        across, down = margins(target, THIN)
        ways = [lambda: _drawn(target, settings, backend, most, over, stop, told, after)]
        if across or down:
            ways.append(lambda: _drawn_beyond(target, settings, backend, most, over, stop))
            ways += [lambda: _cells(target, settings, backend)] if most is None else []
        return best_of_thin(ways)

    made = drawn(most)
    low, high = 0, len(made.scene)  # regions that fit into the size, and that do not
    best, size = made, _size(made, settings)
    if not settings.max_bytes or size <= settings.max_bytes:
        return made
    for _ in range(FEWER_ROUNDS):
        share = settings.max_bytes / size if not low else 0.5
        count = min(max(low + round(share * (high - low)), low + 1), high - 1)
        if count <= low or over():
            break
        if tries:
            tries.left = max(min(tries.left, float(log2(high - low))) - 1, 0.0)
        made = drawn(count)
        size = _size(made, settings)
        if size <= settings.max_bytes:
            low, best = count, made
        else:
            high = count
            best = best if low else made
    return best


def _cells(target: FloatArray, settings: Settings, backend: Backend) -> Fit:
    """Pixel art."""
    scene, per_pixel = trace_pixels(target, solid_color(settings.background))
    if settings.is_limited:
        scene = limited(scene.take(solid_shapes(scene)), settings)
    return _made(scene, per_pixel, target, backend, interrupted=False)


def _drawn_beyond(
    target: FloatArray, settings: Settings, backend: Backend, most: int | None, over: Stop, stop: Stop | None
) -> Fit:
    """As ``_drawn``, of the picture continued beyond its borders."""
    across, down = margins(target, THIN)
    made = _drawn(
        continued(target, across, down), settings, backend, most, over, stop, lambda traced: None, 0.0
    )
    scene = cut(made.scene, across, down)
    return _made(scene, made.per_pixel, target, backend, interrupted=made.interrupted)


def _size(made: Fit, settings: Settings) -> int:
    """Bytes of the file."""
    return len(finished(made.scene, settings, made.per_pixel).encode())


FEWER_ROUNDS = 5
"""Numbers of regions at the most that are tried for ``max_bytes``."""


class Tries:
    """The progress of drawings of fewer and fewer regions, until a file has its size."""

    def __init__(self, report: Report | None, most: int) -> None:
        """``most``: bytes of the file."""
        self._meter, self._most = Meter(report), most
        self._regions = 0
        self.left = float(FEWER_ROUNDS)
        """How many follow."""

    def begun(self, traced: Scene) -> Report | None:
        """What the next one reports to."""
        if not self._regions:
            self._regions = max(len(traced), 1)
            fits = FINISHED * len(write_svg(traced)) <= self._most
            self.left = 0.0 if fits else min(self.left, float(log2(self._regions + 1)))
        return self._meter.stage(math.sqrt(len(traced) / self._regions), self.left * SMALLER)


FINISHED, SMALLER = 0.8, 0.7
"""Bytes of a drawing over those as it was traced; work on one of the right size over that on the first. For
progress: in the mean."""


def _drawn(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    most: int | None,
    over: Stop,
    stop: Stop | None,
    told: Callable[[Scene], Report | None],
    after: float,
) -> Fit:
    """A drawing of ``most`` regions, finished. ``told``: what is reported to, by what was traced."""
    size, whole = enlargement(target), (target.shape[1], target.shape[0])
    shown, target = target, np.ascontiguousarray(target[::size, ::size])
    traced = trace(target, most=most)
    drawing = Drawing(traced.scene, traced.joints, traced.same)
    if settings.is_limited:
        drawing = drawing.take(solid_shapes(drawing.scene))
        drawing = replace(drawing, scene=limited(drawing.scene, settings))
    done = finish_drawing(
        target,
        drawing,
        backend,
        Refinement(),
        finest=finest(settings),
        tidy=settings.tidy,
        report=told(drawing.scene),
        after=after,
        stop=over,
    )
    scene, per_pixel = enlarged(done.drawing.scene, size, *whole), done.per_pixel / size
    return _made(scene, per_pixel, shown, backend, interrupted=bool(stop and stop()))


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
