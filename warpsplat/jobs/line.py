"""Line art in, strokes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.fit.loop import Fit, Progress, fit
from warpsplat.fit.settings import Density, Settings, solid_color
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, IndexArray, Scene
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


def draw_lines(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    seconds: float | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Fit:
    """Trace line art as strokes, and refine them against its ink; arguments are those of ``fit``.

    The strokes of a pen are a layer, ``pen-1-rrggbb`` of the one that is used most, in an order of little way
    with the pen lifted.

    Raises:
        ImageError: there is no ink.
    """
    ink = find_ink(target)
    color = solid_color(settings.background)
    if color is not None or settings.background == "none":
        ink = replace(ink, paper=color)
    traced = trace_ink(ink).scene
    if not len(traced):
        raise ImageError("no lines found: nothing is darker than the paper around it")
    start = replace(
        traced, layer=np.zeros_like(traced.layer), canvas=replace(traced.canvas, background=_paper(ink))
    )
    chosen = line_settings(settings, len(traced))
    made = fit(inked(ink, traced), chosen, backend, scene=start, seconds=seconds, report=report, stop=stop)
    scene = replace(made.scene, layer=traced.layer, colors=traced.colors, canvas=traced.canvas)
    scene = replace(rejoined(traced, scene), layer_names=pen_names(traced))
    return replace(made, scene=toured(scene))


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


def pen_names(scene: Scene) -> tuple[str, ...]:
    """Names of the layers of pens."""
    shown: IndexArray = np.unique(scene.layer, return_index=True)[1]
    colors = np.round(255 * scene.colors[shown]).astype(np.uint8)
    return tuple(f"pen-{number}-{color.tobytes().hex()}" for number, color in enumerate(colors, 1))
