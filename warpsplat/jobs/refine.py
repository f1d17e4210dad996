"""An SVG improved against an image."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from warpsplat.errors import ImageError
from warpsplat.fit.loop import Progress, fit
from warpsplat.fit.settings import Density, Settings
from warpsplat.jobs.vectorize import Result, has_time_for_eyes, missed_goals, training_seconds
from warpsplat.metrics import psnr, score_svg
from warpsplat.render.backend import Backend
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_own, render_svg
from warpsplat.svg.write import minified, write_svg


def refine(
    text: str,
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    name: str,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> tuple[Result, float]:
    """Improve the SVG ``text`` against ``target``; its shapes stay, none is added or removed.

    Args:
        text: the SVG.
        target: sRGB in [0, 1], shape (height, width, 3).
        settings: how long, and what file.
        backend: where to compute.
        name: how messages call the SVG.
        report: called every few steps.
        stop: asked after every step; once true, the shapes as they are make the file.

    Returns:
        the result, and the PSNR of ``text`` itself [dB]. A result that is no better is ``text`` unchanged.
    """
    started = time.monotonic()
    height, width = target.shape[:2]
    scene, has_background = load_scene(text, width, height, name)
    try:
        _check_read(text, scene, has_background)
        before = score_svg(text, target, eyes=False)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    settings = replace(
        settings,
        curves=min(len(scene), 100_000),
        coarse=0.0,
        density=Density(interval=0),
        rates={**settings.rates, "points": REFINE_RATE},
        renderer="exact",
        texture=0.0,  # whether a result is better is for the PSNR to say
    )
    seconds = training_seconds(settings, target, started)
    made = fit(target, settings, backend, scene=scene, seconds=seconds, report=report, stop=stop)
    svg = write_svg(made.scene, per_pixel=made.per_pixel, background=has_background, title=settings.title)
    svg = minified(svg) if settings.minify else svg
    eyes = has_time_for_eyes(settings, target) and not made.interrupted
    score = score_svg(svg, target, own=True, eyes=eyes)
    better = score.psnr > before.psnr
    if eyes and not better:
        before = score_svg(text, target)
    seconds = time.monotonic() - started
    result = Result(
        svg=svg if better else text,
        scene=made.scene if better else scene,
        score=score if better else before,
        render_psnr=made.render_psnr,
        estimated_psnr=made.estimated_psnr,
        iterations=made.iterations,
        seconds=seconds,
        stopped=made.interrupted,
        missed=missed_goals(settings, score, seconds),
    )
    return result, before.psnr


def _check_read(text: str, scene: Scene, has_background: bool) -> None:
    """Compare pictures of the SVG and of what was read of it: nothing may be lost that no rule thought of.

    Raises:
        ImageError: they differ.
    """
    given = render_svg(text, width=scene.canvas.width, height=scene.canvas.height)
    read = render_own(write_svg(scene, background=has_background))
    if given.size != read.size:
        raise ImageError(f"renders as {given.width}x{given.height}, the image is {read.width}x{read.height}")
    alike = psnr(on_white(given), on_white(read))
    if alike < MIN_ALIKE:
        raise ImageError(f"shows something that is not supported ({alike:.1f} dB from what could be read)")


MIN_ALIKE = 25.0
"""Least PSNR [dB] of the scene read against the SVG; what is read in full has over 40."""

REFINE_RATE = 0.5
"""Learning rate of points [px]: the shapes are nearly where they should be."""
