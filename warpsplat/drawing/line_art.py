"""Line art in, strokes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.drawing.filled_areas import filled
from warpsplat.drawing.strokes.ink import Ink, find_ink
from warpsplat.drawing.strokes.lines import TracedLines, rejoined, trace_ink
from warpsplat.drawing.strokes.tour import BEGINS, FEW, MANY, toured
from warpsplat.errors import ImageError
from warpsplat.fit.costs import PIXELS, serial
from warpsplat.fit.loop import Fit, fit
from warpsplat.fit.rounding import finest
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Density, Settings, solid_color
from warpsplat.fit.stages import Stages
from warpsplat.fit.work import Meter, Report
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, IndexArray, Scene

STEPS = 80
"""Of the refinement, at the most: the strokes are where they should be but for fractions of a pixel."""

POINT_RATE = 0.12
"""Learning rate of points [px]."""

WIDTH_RATE = 0.06
"""Of widths [px]."""

STEP_PIXELS, STEP_POINT = 1.45, 0.0022
"""What a step of the refinement costs: of ``costs.PIXELS``, of a point (``fit.costs``)."""

TOUR_STROKE, TOUR_PAIR = 0.3, 0.0021
"""What improving a tour costs, until nothing shortens it: of each stroke, of each pair of strokes."""

LONG_STROKE, LONG_PAIR = 0.25, 0.00006
"""The same of a tour of many strokes, which is improved once."""

THIN = 1.0
"""Width below which a stroke keeps it [px]: the least of a training."""

FINE_PIXELS = 1_000_000
"""Largest size of the image that the refinement sees [pixels]."""


def draw_lines(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    seconds: float | None = None,
    report: Report | None = None,
    after: float = 0.0,
    stop: Callable[[], bool] | None = None,
    stages: Stages | None = None,
) -> Fit:
    """Trace line art as strokes, and refine them against its ink; arguments are those of ``draw``.

    What a pen draws is a layer, ``pen-1-rrggbb`` of the one that is used most: if the settings say mixed its
    filled areas, and strokes in an order of little way with the pen lifted.

    Raises:
        ImageError: there is no ink.
    """
    ink = find_ink(target, mixed=settings.mixed)
    color = solid_color(settings.background)
    if color is not None or settings.background == "none":
        ink = replace(ink, paper=color)
    traced = trace_ink(ink, mixed=settings.mixed)
    if not len(traced.scene) and not traced.areas:
        raise ImageError("no lines found: nothing but specks is darker than the paper around it")
    fills = filled(traced, backend, finest(settings), stop, tidy=settings.tidy) if traced.areas else None
    made = _fitted(
        ink, traced, settings, backend, after, seconds=seconds, report=report, stop=stop, stages=stages
    )
    if fills:
        both = fills.scene.append(made.scene)
        made = replace(
            made,
            scene=both.take(np.argsort(both.layer, kind="stable")),
            per_pixel=max(made.per_pixel, fills.per_pixel),
        )
    layer = np.unique(made.scene.layer, return_inverse=True)[1].astype(np.int32)
    scene = replace(made.scene, layer=layer)
    return replace(made, scene=replace(scene, layer_names=pen_names(scene)))


def _fitted(
    ink: Ink,
    traced: TracedLines,
    settings: Settings,
    backend: Backend,
    after: float,
    *,
    seconds: float | None,
    report: Report | None,
    stop: Callable[[], bool] | None,
    stages: Stages | None,
) -> Fit:
    """The strokes of ``traced``, refined and in the order of a tour."""
    lines = traced.scene
    if not len(lines):
        return Fit(lines, 1.0, 0.0, 0.0, 0, False)
    canvas = replace(lines.canvas, background=_paper(ink))
    start = replace(lines, layer=np.zeros_like(lines.layer), canvas=canvas)
    importance = None
    if traced.areas:  # into which strokes reach
        importance = 1 - traced.areas.cover
        ink = replace(ink, cover=np.where(traced.areas.cover > 0, 0, ink.cover).astype(np.float32))
    fitted = line_settings(settings, len(lines))
    plan = phases(fitted, lines.canvas.width, lines.canvas.height)
    size = plan[-1].width * plan[-1].height / PIXELS
    cost = fitted.iterations * (STEP_PIXELS * size + STEP_POINT * len(lines.points))
    order = serial(backend) * sum(tour_cost(count) for count in np.bincount(lines.layer).tolist())
    made = fit(
        inked(ink, lines),
        fitted,
        backend,
        scene=start,
        importance=importance,
        seconds=seconds,
        report=Meter(report, after).stage(cost, order),
        stop=stop,
        stages=stages,
    )
    # A training knows no strokes thinner than a pixel; how wide they are was measured.
    widths = np.where(lines.widths < THIN, lines.widths, made.scene.widths)
    scene = replace(made.scene, layer=lines.layer, colors=lines.colors, canvas=lines.canvas, widths=widths)
    return replace(made, scene=toured(rejoined(lines, scene)))


def tour_cost(count: int) -> float:
    """Of finding the order of the strokes of a pen (``fit.costs``)."""
    if count > MANY:
        return count * (LONG_STROKE + LONG_PAIR * count)
    tours = BEGINS + 2 if count <= FEW else 2  # from several places, and that of the drawing
    return tours * count * (TOUR_STROKE + TOUR_PAIR * count)


def line_settings(settings: Settings, count: int) -> Settings:
    """What refines ``count`` strokes: their places and widths alone."""
    still = dict.fromkeys(settings.rates, 0.0)
    return replace(
        settings,
        curves=min(count, 100_000),
        iterations=min(settings.iterations, STEPS),
        coarse=0.0,
        fine_pixels=min(settings.fine_pixels, FINE_PIXELS),
        density=Density(interval=0),
        rates={**still, "points": POINT_RATE, "widths": WIDTH_RATE},
        mixed=False,
        renderer="exact",
        texture=0.0,
        viewer=False,  # colours of the file are not those of the picture, but the pens'
        target_psnr=None,
        max_bytes=None,
        levels=(),
    )


def _paper(ink: Ink) -> FloatArray:
    return np.ones(3, np.float32) if ink.paper is None else ink.paper


def inked(ink: Ink, traced: Scene) -> FloatArray:
    """The picture that strokes of these pens would make if they were right: even paper and even ink, so that
    nothing pulls at them but where the ink is. Shape (height, width, 3).
    """
    color = _nearest_colors(traced, ink) if traced.layer.max() > 0 else traced.colors[:1]
    paper = _paper(ink)
    return np.asarray(paper + ink.cover[..., None] * (color - paper), np.float32)


def _nearest_colors(traced: Scene, ink: Ink) -> FloatArray:
    """At each pixel the colour of the pen whose mixture with the paper is the most like it, shape (height,
    width, 3).
    """
    pens = np.unique(traced.colors, axis=0)
    paper = _paper(ink)
    away = [((ink.shown - paper - ink.cover[..., None] * (pen - paper)) ** 2).sum(axis=2) for pen in pens]
    return np.asarray(pens[np.argmin(away, axis=0)], np.float32)


def pen_names(scene: Scene) -> tuple[str, ...]:
    """Names of the layers of pens."""
    shown: IndexArray = np.unique(scene.layer, return_index=True)[1]
    colors = np.round(255 * scene.colors[shown]).astype(np.uint8)
    return tuple(f"pen-{number}-{color.tobytes().hex()}" for number, color in enumerate(colors, 1))
