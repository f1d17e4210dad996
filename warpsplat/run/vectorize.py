"""Turn an image into an SVG file, from top to bottom."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from warpsplat.errors import UsageError, naming
from warpsplat.files.remote import path_of
from warpsplat.files.sources import ImageSource
from warpsplat.fit.checkpoint import SAVE_INTERVAL
from warpsplat.fit.problem import Fit, Problem, Run, Start
from warpsplat.fit.progress import Callback, Progress
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.native import release_memory
from warpsplat.rendering.compiler import compile_seconds
from warpsplat.run.arguments import backend_on, custom_loss, settings_given, takes
from warpsplat.run.checkpoint import identity, open_checkpoint
from warpsplat.run.explained import Explained, explained
from warpsplat.run.figures import Reference, missed_goals
from warpsplat.run.formats import write_named
from warpsplat.run.physical_size import (
    bridge_notes,
    export_within,
    on_removed,
    physical_size,
    with_pixels,
)
from warpsplat.run.prepare import PreparedImage, prepare
from warpsplat.run.result import STOPPED, Result
from warpsplat.run.second_look import other_subject, retaken
from warpsplat.run.strategies import STRATEGIES, Strategy, arranged, choose_strategy
from warpsplat.run.tracking import before_clearing, failed, recorded, report_end, timed
from warpsplat.run.typed import Options
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.numbers import hex_colors

if TYPE_CHECKING:
    from typing_extensions import Unpack


@takes(Options)
def vectorize(
    image: ImageSource,
    curves: int | None = None,
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    output: str | os.PathLike[str] | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    name: str | None = None,
    keyed: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    checkpoint_every: float | str = SAVE_INTERVAL,
    overwrite: bool = False,
    **options: Unpack[Options],
) -> Result:
    """Turn an image into an SVG, and measure how good it is.

    The options are those of the command line; one that is None is chosen as the command line chooses it.

    Args:
        image: a path, the bytes of an image file, a file open for reading, a Pillow image, or an array of
            shape (height, width[, channels]) of uint8, uint16, bool, or floats in [0, 1].
        curves: number of shapes; for drawings, and with a goal, the maximum.
        settings: all options at once, made by ``make_settings``; no further ones may be given then.
        importance: mask of the image's proportions, in any of the image's forms: how much errors count.
        output: file to write the SVG to, before it is measured, or what its name ends with; an existing one
            is replaced (``Result.save(overwrite=False)`` would refuse); ``-`` is the standard output.
        device: ``auto``, ``cpu``, ``cuda`` or ``cuda:N``.
        threads: of the CPU, by default one per core; the result does not depend on them.
        callback: see ``Callback``.
        stop: called after every step; once it returns true, the current shapes make the file.
        name: how messages call the image; default: its file's name.
        keyed: add a key of image and settings to the file, by which batches recognise it.
        checkpoint: file that the state of the run is saved to every ``checkpoint_every`` and when it is
            stopped; removed when the run is done.
        resume: continue from the checkpoint, to the bytes of an uninterrupted run; without one, start.
        checkpoint_every: seconds, or ``"2m"``.
        overwrite: let a run that starts from the beginning replace a checkpoint, or any other file, there.
        options: see ``Options`` and the documentation's table. ``loss`` may be a function of the render, see
            ``LossFunction``, which then replaces the squared error; ``CustomLoss`` lets it join that.

    Returns:
        the SVG, its scene, its score and the run's history.

    Raises:
        UsageError: a setting or device that cannot be used as given.
        ImageError: an image or mask that cannot be read.
        CheckpointError: a checkpoint that cannot be read; one of another run is a ``UsageError``.
        OutputError: ``output`` cannot be written.
        ResourceError: memory, threads, or a place for compiled kernels are missing; or the device cannot be
            used, or failed (``DeviceError``): the ``result`` of that error is what could be saved.
        TypeError: an image of none of these forms, or an unknown keyword.
    """
    if isinstance(curves, (list, tuple)):
        raise UsageError(f"several numbers of shapes: vectorize_several(image, {list(curves)})")
    loss, given = custom_loss(options)
    settings = settings_given(vectorize, settings, curves=curves, **given)
    given_files = (image, importance, output)
    kept = open_checkpoint(checkpoint, checkpoint_every, given_files, resume=resume, overwrite=overwrite)
    write = None if output is None else functools.partial(write_named, path_of(output), dxf=settings.dxf)
    with backend_on(device, threads) as backend:
        prepared = prepare(
            image, settings, name=name, importance=importance, loss=loss, keyed=keyed, backend=backend
        )
        saved = kept.open(identity("vectorize", settings, prepared.problem), backend()) if kept else None
        result = make_result(prepared, Run(backend, callback, stop, checkpoint=saved), write)
    if kept and not result.stopped:
        kept.path.unlink(missing_ok=True)
    return result


def make_result(
    image: PreparedImage, run: Run, write: Callable[[str], None] | None = None, start: Start | None = None
) -> Result:
    """Vectorize a prepared image, and score the file.

    ``write`` is called with the file before it is scored, so that no later failure can lose it. A ``start``
    makes it a plain fit from these shapes, in place of the settings' strategy. Raises ``ImageError``, and
    ``DeviceError`` if the device failed, whose ``result`` is what could be saved and is written.
    """
    begun, compiled, history = time.monotonic(), compile_seconds(), list[Progress]()
    checkpoint = run.checkpoint
    image = with_pixels(image)
    run = timed(recorded(run, history), image.problem.settings, image.problem.target)
    with naming(image.name):
        image, strategy, made = _fitted(image, run, start)
        problem, reduction, settings = image.problem, image.reduction, image.problem.settings
        report_end(made, run, history)
        optics = explained(made, problem) if made.optics and not made.interrupted else None
        made = _arranged(made, problem, strategy, run)
        if checkpoint and made.interrupted:
            checkpoint.save()
        if reduction:
            made, settings = reduction.enlarged(made), reduction.settings(settings)
        drawn = _drawn(made, image, strategy, settings, optics)
        if write:
            write(drawn.file)
        reference = Reference(problem.target, settings, run, reduction)
        score = reference.score(drawn.judged, interrupted=made.interrupted)
        score = score.of_file(drawn.file) if score else None
        render_psnr, render_ssim = reference.render_score(made)
        seconds = time.monotonic() - begun
        result = Result(
            svg=drawn.file,
            scene=drawn.scene,
            score=score,
            render_psnr=render_psnr,
            estimated_psnr=made.estimated_psnr,
            iterations=made.iterations,
            seconds=seconds,
            stopped=made.interrupted,
            renewed=made.renewed,
            device=run.device_name,
            renderer=settings.renderer,
            render_ssim=render_ssim,
            missed=missed_goals(settings, score, seconds, compile_seconds() - compiled),
            levels=reference.level_scores(drawn.scene, made.per_pixel) if score else (),
            reduced=reduction.words() if reduction else "",
            subject=settings.subject,
            why=image.why,
            notes=drawn.notes,
            optics=optics,
            history=tuple(history),
        )
    release_memory()
    if run.failures:
        raise failed(run, image.name, result)
    return result


def _fitted(image: PreparedImage, run: Run, start: Start | None) -> tuple[PreparedImage, Strategy, Fit]:
    """Return what is made of an image; and that image, which may turn out to be another subject's.

    Raises ``DeviceError`` if the device failed before there was anything to save.
    """
    while True:
        problem = image.problem
        strategy = choose_strategy(problem.settings) if start is None else STRATEGIES["fit"]
        part = run if strategy.traces else before_clearing(run, problem.target)
        if start is not None:
            from warpsplat.fit.loop import fit

            made, other = fit(problem, part, start), None
        else:
            made = _made(problem, strategy, part)
            other = other_subject(made, problem) if image.why else None
        if not other:
            break
        image = retaken(image, other)
    if run.failures and not (made.iterations or strategy.traces):
        raise run.failures[0]
    return image, strategy, made


class _File(NamedTuple):
    """A fit as a file."""

    file: str
    judged: str
    """Its text that the figures are of: on the background that was removed from it."""
    scene: Scene
    notes: tuple[str, ...]


def _drawn(
    made: Fit, image: PreparedImage, strategy: Strategy, settings: Settings, optics: Explained | None
) -> _File:
    """Return the file of what was made of an image."""
    release_memory()
    physical = physical_size(image, settings)
    problem, shown, notes = image.problem, made.scene, image.notes
    background = shown.canvas.background
    # A file that was cut short must not pass for a finished one.
    metadata = STOPPED if made.interrupted else problem.metadata
    is_removed = strategy.traces and (problem.removes_background or bool(settings.bridges))
    if is_removed:
        notes += removal_notes(background, settings)
        shown = replace(shown, canvas=replace(shown.canvas, background=solid_color(settings.background)))
    svg, scene = export_within(shown, settings, made.per_pixel, metadata, physical)
    judged = svg
    if is_removed and background is not None:
        judged = on_removed(svg, scene, settings, made.per_pixel, background)
    notes += (optics.words(),) if optics else ()
    notes += (*physical.notes(), *bridge_notes(scene, settings, made.per_pixel))
    return _File(physical.given_to(svg), judged, scene, notes)


def _made(problem: Problem, strategy: Strategy, run: Run) -> Fit:
    """Return what a strategy makes; of a drawing whose device fails, the trace alone, which needs none."""
    if strategy is not STRATEGIES["drawing"]:
        return strategy.make(problem, run)
    if found := run.attempt(lambda: strategy.make(problem, run)):
        return found
    failure = run.failures.pop()  # with which the draft would be stopped
    made = STRATEGIES["draft"].make(problem.having(tidy=False), run)
    run.failures.append(failure)
    return replace(made, interrupted=True)


def _arranged(made: Fit, problem: Problem, strategy: Strategy, run: Run) -> Fit:
    """Return ``arranged``, without what takes the device if that fails."""
    if strategy.uses_device:
        if found := run.attempt(lambda: arranged(made, problem, strategy, run)):
            return found
        made = replace(made, interrupted=True)
    return arranged(made, problem, strategy, run)


def removal_notes(color: FloatArray | None, settings: Settings) -> tuple[str, ...]:
    """Return the note that a background, sRGB in [0, 1], shape (3,), was removed."""
    if color is None and not settings.removal:
        return ()
    named = "" if color is None else f", {hex_colors(color[None])[0]},"
    what = {"outside": "removed from the border inwards", "everywhere": "removed everywhere"}
    done = what[settings.removal] if settings.removal else "left out, as stencils have none"
    return (f"the background{named} was {done}; the figures are those of the file on it",)
