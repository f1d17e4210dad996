"""Image in, SVG file and its score out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.files.sources import ImageSource
from warpsplat.fit.export import finished
from warpsplat.fit.place import simple_curves
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.settings import Settings
from warpsplat.fit.stages import Stages
from warpsplat.fit.work import Progress
from warpsplat.native import release_memory
from warpsplat.rendering.backend import Backend
from warpsplat.run.checkpoint import CheckpointFile, identity
from warpsplat.run.figures import level_scores, missed_goals, pixels_of, render_figures, scored
from warpsplat.run.formats import write_named
from warpsplat.run.keys import STOPPED
from warpsplat.run.prepare import Prepared, prepare
from warpsplat.run.reduction import Reduction
from warpsplat.run.result import Result
from warpsplat.run.training import Training, arranged, cost_after, noting, trained, training_seconds, way_of
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.geometry import areas
from warpsplat.search.several import Start
from warpsplat.svg.page import placed


def vectorize_image(
    source: ImageSource,
    settings: Settings,
    backend: Backend,
    *,
    output: Path | None = None,
    name: str | None = None,
    importance: ImageSource | None = None,
    keyed: bool = False,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    checkpoint: CheckpointFile | None = None,
) -> Result:
    """Read an image, vectorize it, write ``output`` atomically, and score it.

    Args:
        source: the image.
        settings: all that decides the result.
        backend: where to compute.
        output: the SVG, or its picture (``run.formats``); ``-`` is the standard output; None: it is not
            written.
        name: how messages call the image; default: its file's name.
        importance: a mask, see ``load_importance``.
        keyed: whether the file names the job that made it (``job_key``), for batches to go on from; image and
            mask are files then.
        report: called every few steps.
        stop: asked after every step, see ``vectorize``.
        checkpoint: where the state of the run is kept until it is done.

    Raises:
        ImageError: ``source`` or the mask cannot be read, or their proportions differ.
        OutputError: ``output`` cannot be written.
        CheckpointError, UsageError: see ``CheckpointFile``.
        ResourceError: the limit of memory is too low for any size.
    """
    work = prepare(source, settings, name=name, importance=importance, keyed=keyed)
    stages = None
    if checkpoint:
        identified = identity("vectorize", settings, work.target, work.importance)
        stages = checkpoint.stages(identified, backend)
    result = make(work, backend, output=output, report=report, stop=stop, stages=stages)
    if checkpoint and not result.stopped:
        checkpoint.remove()
    return result


def make(
    work: Prepared,
    backend: Backend,
    *,
    start: Start | None = None,
    output: Path | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    stages: Stages | None = None,
) -> Result:
    """A run on what was prepared, and its file; arguments are those of ``vectorize_image``, ``start`` that of
    ``vectorize``.
    """
    settings, history = work.settings, list[Progress]()

    try:
        result = vectorize(
            work.target,
            settings,
            backend,
            metadata=work.key,
            start=start,
            importance=work.importance,
            report=noting(history, report),
            stop=stop,
            write=None if output is None else lambda file: write_named(output, file),
            stages=stages,
            reduction=work.reduction,
        )
    except ImageError as error:  # of what only the work itself finds out
        raise ImageError(f"{work.name}: {error}") from error
    release_memory()
    return replace(result, subject=settings.subject, why=work.why, history=tuple(history))


def vectorize(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    metadata: str = "",
    start: Start | None = None,
    importance: FloatArray | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    write: Callable[[str], None] | None = None,
    stages: Stages | None = None,
    reduction: Reduction | None = None,
) -> Result:
    """Fit shapes to ``target`` and score the file they make.

    Args:
        target: the image, sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape
            (height, width, 4), it makes a file without a background.
        settings: all that decides the result; a subject ``auto`` is fitted as a photograph is.
        backend: where to compute; does not change the result.
        metadata: text for the file's metadata; that of a run that was stopped says so instead.
        start: how to begin, in place of with new shapes.
        importance: how much the error of a pixel counts: grey mask in [0, 1], of any size. The figures are
            those of the whole image all the same.
        report: called every few steps.
        stop: asked after every step; once true, the shapes as they are make the file. True later, the score
            is given up.
        write: called with the file before it is scored, so that nothing that goes wrong then can lose it.
        stages: what the run goes on from, and is told of its state. A run within a time budget, and tracing,
            begin again: the one has no two runs alike, the other has no state but its beginning.
        reduction: of a larger image to ``target``; the file is of that one's size.
    """
    started = time.monotonic()
    way = way_of(settings, start)
    training = Training(
        target,
        settings,
        backend,
        metadata=metadata,
        start=start,
        importance=importance,
        seconds=training_seconds(settings, target, started),
        watching={
            "report": report,
            "after": cost_after(settings, target, backend, way),
            "stop": stop,
            "stages": None if settings.time_budget else stages,
        },
    )
    if way == "fit" and settings.simplify and start is None:
        settings = replace(settings, curves=min(settings.curves, simple_curves(target)))
        training = replace(training, settings=settings)
    made = trained(training, way)
    if stages and made.interrupted:
        stages.save()
    made = arranged(made, training, way)
    if reduction:
        made, settings = reduction.enlarged(made), reduction.settings(settings)
    release_memory()
    # A file that was cut short must not pass for a finished one.
    svg, scene = export_within(
        made.scene, settings, made.per_pixel, STOPPED if made.interrupted else metadata
    )
    file = on_paper(svg, settings)
    if write:
        write(file)
    score = scored(svg, target, settings, stop, reduction, interrupted=made.interrupted)
    if score:
        score = score.of_file(file)
    render_psnr, render_ssim = made.render_psnr, None
    soft = renderer_of(settings.renderer).soft
    if soft and not reduction and pixels_of(target) <= settings.fine_pixels:
        render_psnr, render_ssim = render_figures(made.scene, target, settings, backend)
    seconds = time.monotonic() - started
    levels = bool(score and settings.levels)
    return Result(
        svg=file,
        scene=scene,
        score=score,
        render_psnr=render_psnr,
        estimated_psnr=made.estimated_psnr,
        iterations=made.iterations,
        seconds=seconds,
        stopped=made.interrupted,
        renewed=made.renewed,
        renderer=settings.renderer,
        render_ssim=render_ssim,
        missed=missed_goals(settings, score, seconds),
        levels=level_scores(scene, settings, made.per_pixel, target, reduction) if levels else (),
        reduced=reduction.words() if reduction else "",
    )


def export_within(scene: Scene, settings: Settings, per_pixel: float, metadata: str) -> tuple[str, Scene]:
    """The SVG, and the shapes in it: all, or those that show most where ``max_bytes`` has room for few."""

    def made() -> tuple[str, int]:
        text = finished(scene, settings, per_pixel, metadata)
        return text, len(on_paper(text, settings).encode())

    svg, size = made()
    while settings.max_bytes and size > settings.max_bytes and len(scene) > 1:
        excess = 1 - settings.max_bytes / size
        count = min(max(1, round(excess * len(scene))), len(scene) - 1)
        seen = areas(scene) * scene.opacities
        scene = scene.take(np.sort(np.argsort(seen, kind="stable")[count:]))
        svg, size = made()
    return svg, scene


def on_paper(svg: str, settings: Settings) -> str:
    """The file that is delivered: ``svg`` on the sheet that ``settings`` ask for, if they do."""
    return placed(svg, settings.size, settings.page, settings.units)
