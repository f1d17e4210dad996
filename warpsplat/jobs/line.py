"""Line art in, strokes out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.fit.loop import Progress, fit
from warpsplat.fit.settings import Density, Settings
from warpsplat.jobs.vectorize import Result, has_time_for_eyes, missed_goals, training_seconds
from warpsplat.metrics import score_svg
from warpsplat.render.backend import Backend
from warpsplat.scene import FloatArray, IndexArray, Scene
from warpsplat.svg.page import Sheet, on_sheet
from warpsplat.svg.write import write_svg
from warpsplat.trace.ink import Ink, find_ink
from warpsplat.trace.lines import rejoined, trace_ink
from warpsplat.trace.tour import toured

STEPS = 80
"""Of the refinement, at the most: the strokes are where they should be but for fractions of a pixel."""

POINT_RATE = 0.12
"""Learning rate of points [px]."""

WIDTH_RATE = 0.06
"""Of widths [px]."""

FINE_PIXELS = 1_000_000
"""Largest size of the image that the refinement sees [pixels]."""


def vectorize_lines(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    metadata: str = "",
    sheet: Sheet | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    write: Callable[[str], None] | None = None,
) -> Result:
    """Trace line art as strokes, refine them against its ink, and score the file they make.

    The strokes of a pen are a group, ``pen-1-rrggbb`` the one that is used most, in an order of little way
    with the pen lifted.

    Args:
        target: the image, sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape
            (height, width, 4).
        settings: how long, and what file.
        backend: where to compute.
        metadata: text for the file's metadata; that of a run that was stopped says so instead.
        sheet: what the file is drawn on; None: as large as the image. The figures are those of the image.
        report: called every few steps.
        stop: asked after every step; once true, the strokes as they are make the file.
        write: called with the SVG before it is scored.

    Raises:
        ImageError: there is no ink.
    """
    started = time.monotonic()
    ink = find_ink(target)
    traced = trace_ink(ink).scene
    if not len(traced):
        raise ImageError("no lines found: nothing is darker than the paper around it")
    pens = traced.layer
    settings = line_settings(settings, len(traced))
    made = fit(
        inked(ink, traced),
        settings,
        backend,
        scene=replace(
            traced, layer=np.zeros_like(pens), canvas=replace(traced.canvas, background=_paper(ink))
        ),
        seconds=training_seconds(settings, target, started),
        report=report,
        stop=stop,
    )
    scene = replace(made.scene, layer=pens, colors=traced.colors, canvas=traced.canvas)
    scene = toured(rejoined(traced, scene))
    text = write_svg(
        scene,
        per_pixel=made.per_pixel,
        metadata="stopped" if made.interrupted else metadata,
        groups=pen_names(scene),
    )
    svg = on_sheet(text, sheet) if sheet else text
    if write:
        write(svg)
    score = score_svg(
        text, target, own=True, eyes=has_time_for_eyes(settings, target) and not made.interrupted
    )
    seconds = time.monotonic() - started
    return Result(
        svg=svg,
        scene=scene,
        score=score,
        render_psnr=made.render_psnr,
        estimated_psnr=made.estimated_psnr,
        iterations=made.iterations,
        seconds=seconds,
        stopped=made.interrupted,
        missed=missed_goals(settings, score, seconds),
    )


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


def pen_names(scene: Scene) -> list[str]:
    """Names of the groups of the pens."""
    shown: IndexArray = np.unique(scene.layer, return_index=True)[1]
    colors = np.round(255 * scene.colors[shown]).astype(np.uint8)
    return [f"pen-{number}-{color.tobytes().hex()}" for number, color in enumerate(colors, 1)]
