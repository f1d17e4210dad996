"""An SVG improved against an image."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PIL import Image

from warpsplat.errors import ImageError
from warpsplat.fit.clear import clear_empty
from warpsplat.fit.costs import Course, score_cost
from warpsplat.fit.export import show
from warpsplat.fit.loop import fit
from warpsplat.fit.settings import Density, Settings, solid_color
from warpsplat.fit.work import Meter, Progress
from warpsplat.metrics import decibels, score_svg
from warpsplat.native import release_memory
from warpsplat.rendering.backend import Backend
from warpsplat.run.checkpoint import CheckpointFile, identity
from warpsplat.run.figures import has_time_for_eyes, missed_goals
from warpsplat.run.result import Result
from warpsplat.run.training import noting, training_seconds
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.page import OUR_VIEW, on_sheet_of, picture_view, with_view
from warpsplat.svg.read import load_scene
from warpsplat.svg.read_kept import KeptScene, load_kept
from warpsplat.svg.strips import rows_of
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import minified, shortened, write_svg


def refine(
    text: str,
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    name: str,
    keep: bool = False,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    checkpoint: CheckpointFile | None = None,
) -> Result:
    """Improve the SVG ``text`` against ``target``; its shapes stay, none is added or removed.

    A result that is no better is the SVG unchanged. A picture on a sheet (``svg.page``) stays on it.

    Args:
        text: the SVG.
        target: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width,
            4), an SVG without a background stays without one.
        settings: how long, and what file.
        backend: where to compute.
        name: how messages call the SVG.
        keep: keep elements that the scene cannot hold as they are, in their place, instead of refusing them.
        report: called every few steps.
        stop: asked after every step; once true, the shapes as they are make the file.
        checkpoint: where the state of the run is kept; it is for the caller to remove.

    Raises:
        ImageError: the SVG cannot be read, or held.
        CheckpointError, UsageError: see ``CheckpointFile``.
    """
    started = time.monotonic()
    stages = (
        checkpoint.stages(identity("refine", settings, target, svg=text), backend) if checkpoint else None
    )
    given, view = text, None
    if OUR_VIEW.match(text):
        view = picture_view(text, target.shape[1], target.shape[0])
    if view:
        text = with_view(text, view, target.shape[1], target.shape[0])
    base, target, has_background = _load(text, target, settings, name, keep=keep)
    scene = base.scene
    before = score_svg(text, target, eyes=False)
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
    history: list[Progress] = []
    height, width = target.shape[:2]
    eyes = has_time_for_eyes(settings, target)
    after = score_cost(width * height, settings.curves, backend, eyes=eyes)
    cost = Course.of(settings, width, height, backend).cost()
    made = fit(
        target,
        settings,
        backend,
        scene=scene,
        seconds=seconds,
        report=Meter(noting(history, report), after).stage(cost, 0),
        stop=stop,
        stages=None if settings.time_budget else stages,
    )
    if stages and made.interrupted:
        stages.save()
    release_memory()
    refined = made.scene
    if target.shape[2] == 4 and not made.interrupted:
        refined = clear_empty(refined, target, settings, backend, made.per_pixel)
    svg = write_svg(
        refined, per_pixel=made.per_pixel, background=has_background, title=settings.title, ids=settings.ids
    )
    svg = minified(svg) if settings.minify else svg if view else shortened(svg)
    eyes = eyes and not made.interrupted
    score = score_svg(svg, target, own=not scene.pictures, eyes=eyes)
    better = score.psnr > before.psnr
    if eyes and not better:
        before = score_svg(text, target)
    if view:
        svg = on_sheet_of(given, view, svg)
        score, before = score.of_file(svg), before.of_file(given)
    seconds = time.monotonic() - started
    return Result(
        svg=svg if better else given,
        scene=refined if better else scene,
        score=score if better else before,
        render_psnr=made.render_psnr,
        estimated_psnr=made.estimated_psnr,
        iterations=made.iterations,
        seconds=seconds,
        stopped=made.interrupted,
        renewed=made.renewed,
        missed=missed_goals(settings, score, seconds),
        history=tuple(history),
        before=before.psnr,
        kept=base.kept,
    )


def _load(
    text: str, target: FloatArray, settings: Settings, name: str, *, keep: bool
) -> tuple[KeptScene, FloatArray, bool]:
    """The SVG's scene, what it is to show, and whether the file has a background.

    One that the SVG has lies behind a transparent image as well; ``Settings.background`` may ask for another
    one, or for none, which makes it a shape as any other.
    """
    height, width = target.shape[:2]
    apart = settings.background != "none"
    if keep:
        base = load_kept(text, width, height, name, background_apart=apart)
    else:
        base = KeptScene(*load_scene(text, width, height, name, background_apart=apart), "")
    try:
        _check_read(text, base.scene, base.has_background)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    background, has_background = base.scene.canvas.background, base.has_background
    color = solid_color(settings.background)
    if color is not None:
        background, has_background = color, True
    elif target.shape[2] == 4 and not has_background:
        background = None
    if background is not None and target.shape[2] == 4:
        target = np.asarray(target[..., :3] + (1 - target[..., 3:]) * background, np.float32)
    scene = replace(base.scene, canvas=replace(base.scene.canvas, background=background))
    return replace(base, scene=scene), target, has_background


def _check_read(text: str, scene: Scene, has_background: bool) -> None:
    """Compare pictures of the SVG and of what was read of it: nothing may be lost that no rule thought of.

    Raises:
        ImageError: they differ.
    """
    given = render_svg(text, width=scene.canvas.width, height=scene.canvas.height)
    read = show(write_svg(scene, background=has_background), scene)
    if given.size != read.size:
        raise ImageError(f"renders as {given.width}x{given.height}, the image is {read.width}x{read.height}")
    alike = likeness(given, read)
    if alike < MIN_ALIKE:
        raise ImageError(f"shows something that is not supported ({alike:.1f} dB from what could be read)")


def likeness(one: Image.Image, other: Image.Image) -> float:
    """PSNR of pictures of one size, on white [dB]; strip by strip, as each has 24 bytes a pixel there."""
    width, height = one.size
    error = 0.0
    for rows in rows_of(width, height):
        a, b = (on_white(picture.crop((0, rows.start, width, rows.stop))) for picture in (one, other))
        error += float(np.square(a - b).sum())
    return decibels(error / (3 * width * height))


MIN_ALIKE = 25.0
"""Least PSNR [dB] of the scene read against the SVG; what is read in full has over 40."""

REFINE_RATE = 0.5
"""Learning rate of points [px]: the shapes are nearly where they should be."""
