"""Improve an SVG against an image."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warpsplat.errors import ImageError, naming
from warpsplat.files.remote import path_of
from warpsplat.files.sources import ImageSource, held, source_name
from warpsplat.fit.checkpoint import SAVE_INTERVAL
from warpsplat.fit.clear import clear_empty
from warpsplat.fit.export import for_machines, show
from warpsplat.fit.loop import fit
from warpsplat.fit.objective import loss_of_file
from warpsplat.fit.problem import Fit, Problem, Run, Start
from warpsplat.fit.progress import Callback, Progress
from warpsplat.fit.settings import Density, Settings, make_settings, solid_color
from warpsplat.metrics import decibels, score_svg
from warpsplat.native import release_memory
from warpsplat.rendering.compiler import compile_seconds
from warpsplat.run.arguments import backend_on, check_keywords, custom_loss, takes
from warpsplat.run.checkpoint import identity, open_checkpoint
from warpsplat.run.figures import has_time_for_ssimulacra2, missed_goals
from warpsplat.run.formats import check_paths, write_named
from warpsplat.run.memory import DeviceMemory, check_refined
from warpsplat.run.prepare import load_target
from warpsplat.run.result import Result
from warpsplat.run.svg import SvgSource, svg_name_of, text_of
from warpsplat.run.tracking import before_clearing, failed, recorded, timed
from warpsplat.run.typed import RefineOptions
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.page import OUR_VIEW, on_sheet_of, picture_view, with_view
from warpsplat.svg.read import KeptScene, load_kept
from warpsplat.svg.viewer import on_white, render_svg, rows_of
from warpsplat.svg.write import minified, shortened, write_svg

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(RefineOptions)
def refine(
    svg: SvgSource,
    image: ImageSource,
    *,
    iterations: int = 200,
    max_memory: int | str | None = None,
    keep: bool = False,
    settings: Settings | None = None,
    output: str | os.PathLike[str] | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    name: str | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    checkpoint_every: float | str = SAVE_INTERVAL,
    overwrite: bool = False,
    **options: Unpack[RefineOptions],
) -> Result:
    """Improve the paths of any SVG against an image by gradient descent; none is added.

    Arguments that differ from those of ``vectorize``:
        svg: a string with a ``<`` in it is the SVG's text, any other its path; or bytes, or an open file.
        iterations: steps.
        max_memory: bytes, or ``"4GB"``; default: that of the machine. An image that takes more is refused, as
            all of its pixels decide whether a result is better.
        keep: keep text, images, filters ... as they are, in their place, instead of refusing them.
        name: of the SVG, in messages.

    Returns:
        the result, or the SVG unchanged if nothing better was found; ``before`` is the SVG's own PSNR.

    Raises:
        UsageError, ImageError, CheckpointError, OutputError, ResourceError, TypeError: as for
            ``vectorize``; an SVG that cannot be read, or held, is an ``ImageError``.
    """
    check_keywords(refine, options)
    loss, given = custom_loss(options)
    settings = settings or make_settings(iterations=iterations, max_memory=max_memory, **given)
    name = name or svg_name_of(svg)
    text, image_name = text_of(svg, name), source_name(image)
    pixels = held(image)
    check_refined(pixels, settings, image_name)
    if output is not None:
        check_paths(path_of(output), text, name)
    problem = Problem(load_target(pixels, image_name, settings.background), settings, loss=loss)
    kept = open_checkpoint(checkpoint, checkpoint_every, (image, output), resume=resume, overwrite=overwrite)
    with backend_on(device, threads) as backend:
        check_refined(pixels, settings, image_name, DeviceMemory.of(backend().device))
        saved = kept.open(identity("refine", settings, problem, text), backend()) if kept else None
        run = Run(backend, callback, stop, checkpoint=saved)
        result = refine_svg(text, problem, run, name, keep=keep)
    if output is not None:
        write_named(path_of(output), result.svg, dxf=settings.dxf)
    if run.failures:
        raise failed(run, name, result)
    if kept and not result.stopped:
        kept.path.unlink(missing_ok=True)
    return result


def refine_svg(text: str, problem: Problem, run: Run, name: str, *, keep: bool = False) -> Result:
    """Improve an SVG's text; a result that is no better, by PSNR or another loss, is the SVG unchanged.

    A picture on a sheet (``svg.page``) stays on it. Arguments and errors are those of ``refine``.
    """
    begun, compiled, history = time.monotonic(), compile_seconds(), list[Progress]()
    checkpoint = run.checkpoint
    run = timed(recorded(run, history), problem.settings, problem.target)
    given, view = text, None
    if OUR_VIEW.match(text):
        view = picture_view(text, *problem.size)
    if view:
        text = with_view(text, view, *problem.size)
    base, target, has_background = _load(text, problem, name, keep=keep)
    scene = base.scene
    before = score_svg(text, target, perceptual=False)
    settings = _settings(problem.settings, len(scene))
    problem = replace(problem, target=target, settings=settings)
    made = fit(problem, before_clearing(run, target), Start(scene=scene))
    judged = problem.loss or settings.loss != "l2"  # on the device
    if run.failures and (judged or not made.iterations):
        raise run.failures[0]
    made = _cleared(made, problem, run)
    refined = made.scene
    if checkpoint and made.interrupted:
        checkpoint.save()
    release_memory()
    bare = refined if has_background else replace(refined, canvas=replace(refined.canvas, background=None))
    shown = for_machines(bare, settings, made.per_pixel)
    svg = write_svg(shown, per_pixel=made.per_pixel, title=settings.title, ids=settings.ids)
    svg = minified(svg) if settings.minify else svg if view else shortened(svg)
    perceptual = has_time_for_ssimulacra2(settings, target) and not made.interrupted
    score = score_svg(svg, target, own=not scene.pictures, perceptual=perceptual)
    better = score.psnr > before.psnr
    if judged:
        after, start = (loss_of_file(each, refined, problem, run.backend) for each in (svg, text))
        better = after < start
    better = better or settings.reshapes  # cuts cost some decibels
    if perceptual and not better:
        before = score_svg(text, target)
    if view:
        svg = on_sheet_of(given, view, svg)
        score, before = score.of_file(svg), before.of_file(given)
    seconds = time.monotonic() - begun
    return Result(
        svg=svg if better else given,
        scene=refined if better else scene,
        score=score if better else before,
        render_psnr=made.render_psnr,
        estimated_psnr=made.estimated_psnr,
        iterations=made.iterations,
        seconds=seconds,
        stopped=made.interrupted,
        device=run.device_name,
        renewed=made.renewed,
        missed=missed_goals(settings, score, seconds, compile_seconds() - compiled),
        history=tuple(history),
        before=before.psnr,
        kept=base.kept,
    )


def _cleared(made: Fit, problem: Problem, run: Run) -> Fit:
    """Return a fit whose outlines are drawn back from where the image is empty, unless the device fails."""
    if problem.target.shape[2] != 4 or made.interrupted:
        return made
    target, settings = problem.target, problem.settings
    scene = run.attempt(lambda: clear_empty(made.scene, target, settings, run, made.per_pixel))
    return replace(made, scene=made.scene if scene is None else scene, interrupted=run.stopped())


def _settings(settings: Settings, count: int) -> Settings:
    """Return the settings of a fit of ``count`` shapes that all stay."""
    refine_rate = 0.5  # learning rate of points [px]: the shapes are nearly where they should be
    return replace(
        settings,
        curves=min(count, 100_000),
        coarse=0.0,
        density=Density(interval=0),
        rates={**settings.rates, "points": refine_rate},
        renderer="exact",
        texture=0.0,  # the unweighted loss decides whether a result is better
    )


def _load(text: str, problem: Problem, name: str, *, keep: bool) -> tuple[KeptScene, FloatArray, bool]:
    """Return the SVG's scene, the image it is fitted to, and whether the file has a background.

    The SVG's own background lies behind a transparent image as well; ``Settings.background`` may ask for
    another one, or for none, which makes it a shape as any other.
    """
    target, settings = problem.target, problem.settings
    width, height = problem.size
    apart = settings.background != "none"
    base = load_kept(text, width, height, name, background_apart=apart, keep=keep, forms=True)
    with naming(name):
        _check_read(text, base.scene, base.has_background)
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
    """Raise ``ImageError`` if pictures of the SVG and of the scene that was read differ."""
    given = render_svg(text, size=(scene.canvas.width, scene.canvas.height))
    read = show(write_svg(scene, background=has_background), scene)
    if given.size != read.size:
        raise ImageError(f"renders as {given.width}x{given.height}, the image is {read.width}x{read.height}")
    error = 0.0
    for rows in rows_of(*given.size):  # strip by strip to save memory
        a, b = (on_white(each.crop((0, rows.start, given.width, rows.stop))) for each in (given, read))
        error += float(np.square(a - b).sum())
    alike = decibels(error / (3 * given.width * given.height))
    # Least PSNR [dB] of the scene that was read against the SVG; one that was read in full has over 40.
    min_alike = 25.0
    if alike < min_alike:
        raise ImageError(f"contains something that is not supported ({alike:.1f} dB from what could be read)")
