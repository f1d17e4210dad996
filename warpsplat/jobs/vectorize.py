"""Image in, SVG file and its score out."""

from __future__ import annotations

import base64
import hashlib
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from warpsplat._version import __version__
from warpsplat.errors import Stopped
from warpsplat.files.importance import load_importance
from warpsplat.files.sources import ImageSource, Readable, image_of, source_bytes, source_name
from warpsplat.fit.clear import clear_empty
from warpsplat.fit.costs import Course, score_cost
from warpsplat.fit.export import export, finished
from warpsplat.fit.goals import pursue
from warpsplat.fit.layered import fit_layered
from warpsplat.fit.loop import fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.settings import Renderer, Settings, Subject, solid_color
from warpsplat.fit.several import Start
from warpsplat.fit.stages import Stages
from warpsplat.fit.step import model_for
from warpsplat.fit.work import Meter, Progress
from warpsplat.jobs.checkpoint import CheckpointFile, identity
from warpsplat.jobs.formats import write_named
from warpsplat.jobs.memory import has_room_for_eyes
from warpsplat.jobs.reduction import Memory, Reduction
from warpsplat.jobs.subjects import decided, draw
from warpsplat.metrics import Score, psnr, score_svg, ssim
from warpsplat.native import release_memory
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.geometry import areas
from warpsplat.scene.scene import level_ends
from warpsplat.svg.order import by_color, by_opacity
from warpsplat.svg.page import placed


@dataclass(frozen=True)
class LevelScore:
    """What a layered file shows without the layers above a level."""

    shapes: int
    psnr: float | None
    """As a viewer shows it [dB]; None where it is the image itself."""


@dataclass(frozen=True)
class Result:
    """What a run made."""

    svg: str
    scene: Scene
    """What the file shows; of soft Gaussians, the shapes as they were trained: a file holds less of them."""
    score: Score | None
    """Of the SVG as resvg shows it; None where the run was stopped before it was measured."""
    render_psnr: float
    """Of the last training render against the image, at its size [dB]. Of soft Gaussians, where the image is
    no larger than that size: of the finished scene in 8 bits, as the file's is.
    """
    estimated_psnr: float
    """Of the file at that size, as the training saw it: the last look at it may be 25 steps old [dB]."""
    iterations: int
    """Steps done; fewer than asked for when stopped."""
    seconds: float
    stopped: bool
    """Whether it was interrupted."""
    renderer: Renderer = "exact"
    """Of the training."""
    render_ssim: float | None = None
    """Of soft Gaussians' own render."""
    missed: tuple[str, ...] = ()
    """Goals that were not reached, each as a sentence."""
    levels: tuple[LevelScore, ...] = ()
    """Of a layered file, of each level's picture."""
    subject: Subject = "photo"
    """What the image was taken for ..."""
    why: str = ""
    """... and why; empty where it was given."""
    history: tuple[Progress, ...] = field(default=(), repr=False)
    """What was reported of the training, in order."""
    before: float | None = None
    """Of a refined SVG, its own PSNR [dB]."""
    renewed: int = 0
    """Times that a shape was set anew in training since a number of its was not finite."""
    reduced: str = ""
    """What was done to stay below the limit of memory, for people; empty: nothing."""
    kept: str = ""
    """Of a refined SVG, what was kept as it is, for people; empty: nothing."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the SVG, or as the name ends: ``.svgz`` gzipped, ``.png`` as a viewer shows it, ``.pdf`` (the
        extra ``pdf``) its paths. An existing file is replaced in one step: it is there as it was, or whole.

        Raises:
            UsageError: the package that makes PDFs is not installed.
            OutputError: it cannot be written.
        """
        write_named(Path(path), self.svg)

    def as_dict(self) -> dict[str, Any]:
        """For JSON. Figures that were not measured are None."""
        shapes = len(self.scene) - len(self.scene.pictures)
        figures: dict[str, Any] = {f.name: None for f in fields(Score)} | {"bytes": len(self.svg.encode())}
        return {
            **(self.score.as_dict() if self.score else figures),
            "subject": self.subject,
            "why": self.why,
            "renderer": self.renderer,
            "render_psnr": round(self.render_psnr, 3),
            "render_ssim": None if self.render_ssim is None else round(self.render_ssim, 4),
            "estimated_psnr": round(self.estimated_psnr, 3),
            "shapes": shapes,
            "curves": shapes,  # what it was called at first
            "iterations": self.iterations,
            "seconds": round(self.seconds, 2),
            "stopped": self.stopped,
            "renewed": self.renewed,
            "reduced": self.reduced,
            "missed": list(self.missed),
            "levels": [asdict(level) for level in self.levels],
        }


def job_key(settings: Settings, source: bytes, mask: bytes | None = None) -> str:
    """Names a result: the same program version, settings and bytes of image and mask give the same key."""
    masked = "" if mask is None else f"{hashlib.sha256(mask).hexdigest()} "
    digest = hashlib.sha256(f"{__version__} {settings.fingerprint()} {masked}".encode() + source).digest()
    return base64.b64encode(digest[:KEY_BYTES], altchars=b"._").decode()


KEY_BYTES = 6
"""Of a key: it is compared with the one that a file would have, so that chance hits one in 2^48."""


STOPPED = "stopped"
"""In place of a key: of a result that was cut short."""


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
    fits = None if settings.time_budget else stages
    seconds = training_seconds(settings, target, started)
    traced = start is None and settings.subject not in {"auto", "photo"}
    height, width = target.shape[:2]
    pixels, eyes = width * height, has_time_for_eyes(settings, target)
    pursued = start is None and not traced and (settings.target_psnr or settings.max_bytes)
    known = 0 if traced or pursued else settings.curves  # of how many shapes there will be
    after = score_cost(pixels, known, backend, eyes=eyes)
    after += sum(score_cost(pixels, count, backend, eyes=False) for count in settings.levels)
    if pursued:
        made = pursue(
            target,
            settings,
            backend,
            metadata=metadata,
            importance=importance,
            seconds=seconds,
            report=report,
            after=after,
            stop=stop,
            stages=fits,
        )
    elif traced:
        made = draw(
            target, settings, backend, seconds=seconds, report=report, after=after, stop=stop, stages=fits
        )
    elif start is None and settings.levels:
        made = fit_layered(
            target,
            settings,
            backend,
            importance=importance,
            report=report,
            after=after,
            stop=stop,
            stages=fits,
        )
    else:
        if settings.simplify and start is None:
            settings = replace(settings, curves=min(settings.curves, simple_curves(target)))
        made = fit(
            target,
            settings,
            backend,
            scene=start.scene if start else None,
            past=start.past if start else None,
            begin=start.begin if start else 0,
            importance=importance,
            seconds=seconds,
            report=Meter(report, after).stage(
                Course.of(settings, width, height, backend, begin=start.begin if start else 0).cost(), 0
            ),
            stop=stop,
            stages=fits,
        )
    if stages and made.interrupted:
        stages.save()
    if not pursued and not traced and settings.renderer != "gaussian":
        # Soft Gaussians reach beyond the outlines that this order goes by.
        made = replace(made, scene=made.scene.take(by_opacity(made.scene)))
    if target.shape[2] == 4 and not traced and not made.interrupted:
        clear = clear_empty(made.scene, target, settings, backend, made.per_pixel)
        made = replace(made, scene=clear)
    if settings.ids and settings.subject != "line" and settings.renderer != "gaussian":
        made = replace(made, scene=made.scene.take(by_color(made.scene)))
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
    score = _score(svg, target, settings, stop, reduction, interrupted=made.interrupted)
    if score:
        score = score.of_file(file)
    render_psnr, render_ssim = made.render_psnr, None
    fine = not reduction and target.shape[0] * target.shape[1] <= settings.fine_pixels
    if settings.renderer == "gaussian" and fine:
        render_psnr, render_ssim = render_figures(made.scene, target, settings, backend)
    seconds = time.monotonic() - started

    def measured(text: str) -> Score:
        if reduction:
            return reduction.score(text, target, None)
        return score_svg(text, target, own=True, eyes=False)

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
        levels=_level_scores(scene, settings, made.per_pixel, measured) if score and settings.levels else (),
        reduced=reduction.words() if reduction else "",
    )


def training_seconds(settings: Settings, target: FloatArray, started: float) -> float | None:
    """What ``time_budget`` leaves for training, of a run that began at ``started`` (``time.monotonic``)."""
    if settings.time_budget is None:
        return None
    tail = TAIL_SECONDS + TAIL_PER_PIXEL * target.shape[0] * target.shape[1]
    return settings.time_budget - tail - (time.monotonic() - started)


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


def render_figures(
    scene: Scene, target: FloatArray, settings: Settings, backend: Backend, *, scale: int = 1
) -> tuple[float, float | None]:
    """PSNR [dB] and SSIM of the settings' own render of ``scene`` against ``target``, both in 8 bits.

    ``scale``: of the render, which is reduced by area to the image's size before it is compared.
    """
    shown = render(scene, scale=scale, model=model_for(settings, 0), backend=backend)
    levels = np.round(255 * np.clip(shown, 0, 1))
    if scale > 1:
        height, width = target.shape[:2]
        levels = levels.reshape(height, scale, width, scale, 3).mean(axis=(1, 3), dtype=np.float32)
    wanted = np.round(255 * target)
    return psnr(levels, wanted), ssim(levels, wanted)


QUICK_PIXELS = 1_000_000
"""Of an image up to this size, an interrupted run is still scored, and a score that has begun goes on: it
takes about a second."""


def has_time_for_eyes(settings: Settings, target: FloatArray) -> bool:
    """Whether a run's report has SSIMULACRA2, where it is installed: up to ``QUICK_PIXELS`` it takes a
    twentieth of a run of the default effort; within a time budget other things are worth more, and it takes
    much memory.
    """
    pixels = target.shape[0] * target.shape[1]
    return pixels <= QUICK_PIXELS and settings.time_budget is None and has_room_for_eyes(settings, pixels)


def _score(
    svg: str,
    target: FloatArray,
    settings: Settings,
    stop: Callable[[], bool] | None,
    reduction: Reduction | None,
    *,
    interrupted: bool,
) -> Score | None:
    """The score of a file, or None where there is no time for it."""
    quick = target.shape[0] * target.shape[1] <= QUICK_PIXELS
    eyes = has_time_for_eyes(settings, target) and not interrupted
    if (interrupted and not quick) or (not interrupted and stop and stop()):
        return None
    try:
        if reduction:
            return reduction.score(svg, target, stop)
        return score_svg(svg, target, own=True, eyes=eyes, stop=None if quick else stop)
    except Stopped:
        return None


def _level_scores(
    scene: Scene, settings: Settings, per_pixel: float, measured: Callable[[str], Score]
) -> tuple[LevelScore, ...]:
    """Of the files that the first layers alone make, as they are ``measured``."""
    found = []
    for end in (*level_ends(scene), len(scene)):
        text = export(scene.take(np.arange(end)), settings, per_pixel)
        score = measured(text)
        found.append(LevelScore(end, score.as_dict()["psnr"]))
    return tuple(found)


TAIL_SECONDS = 0.3
TAIL_PER_PIXEL = 3e-7
"""Of a time budget: what the last step, exporting and scoring take [s]."""


def missed_goals(settings: Settings, score: Score | None, seconds: float) -> tuple[str, ...]:
    """The goals of ``settings`` that a run did not reach; without a score nobody knows."""
    missed: list[str] = []
    if score is None:
        return ()
    if settings.target_psnr and score.psnr < settings.target_psnr:
        missed.append(f"target-psnr {settings.target_psnr:g} dB: reached {score.psnr:.2f} dB")
    if settings.max_bytes and score.bytes > settings.max_bytes:
        missed.append(f"max-bytes {settings.max_bytes}: reached {score.bytes}")
    if settings.time_budget and seconds > settings.time_budget:
        missed.append(f"time-budget {settings.time_budget:g} s: took {seconds:.1f} s")
    return tuple(missed)


RELEASE_INTERVAL = 10
"""Reports of a run from one release of memory to the next: a release takes as long as a step does."""


def noting(history: list[Progress], report: Callable[[Progress], None] | None) -> Callable[[Progress], None]:
    """What notes in ``history`` all that it is told, and passes it on to ``report``; and has memory that is
    free handed back now and then.
    """

    def note(progress: Progress) -> None:
        history.append(replace(progress, snapshot=None))  # which keeps a run's arrays
        if len(history) % RELEASE_INTERVAL == 0:
            release_memory()
        if report:
            report(progress)

    return note


def load_target(source: ImageSource, name: str | None, background: str, factor: int = 1) -> FloatArray:
    """An image as ``Settings.background`` asks for it: with opacity, (height, width, 4), or on a colour.

    ``factor``: how many times smaller to read it.

    Raises:
        ImageError: as ``image_of``.
    """
    color = solid_color(background)
    image = image_of(source, name, paper=color, factor=factor)
    if background == "none" and image.shape[2] == 3:
        image = np.concatenate([image, np.ones_like(image[..., :1])], axis=2)
    return image


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
        output: the SVG, or its picture (``jobs.formats``); ``-`` is the standard output; None: it is not
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


@dataclass(frozen=True)
class Prepared:
    """An image that was read, and all that a run on it needs to know."""

    target: FloatArray
    """What shapes are fitted to, see ``vectorize``."""
    settings: Settings
    """With a subject."""
    why: str
    """The subject; empty where it was given."""
    importance: FloatArray | None
    reduction: Reduction | None
    key: str = ""
    """Of the job, where the file is to name it."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [px]."""
        if self.reduction:
            return self.reduction.width, self.reduction.height
        return self.target.shape[1], self.target.shape[0]


def prepare(
    source: ImageSource,
    settings: Settings,
    *,
    name: str | None = None,
    importance: ImageSource | None = None,
    keyed: bool = False,
) -> Prepared:
    """Read an image and its mask, at a size that memory has room for, and see what it shows.

    Arguments and errors are those of ``vectorize_image``.
    """
    name = name or source_name(source)
    mask_name = source_name(importance, "the mask")
    key = ""
    source, importance = _read(source), None if importance is None else _read(importance)
    if keyed:
        assert isinstance(source, bytes), "pixels have no key"
        assert importance is None or isinstance(importance, bytes)
        key = job_key(settings, source, importance)
    memory = Memory.of(source, settings, importance)
    factor = memory.factor(name, settings)
    target = load_target(source, name, settings.background, factor)
    chosen, why = decided(target, settings)
    target, factor = memory.smaller(target, name, chosen, factor)
    release_memory()
    work = Prepared(target, chosen, why, None, memory.reduction(factor, target, chosen), key)
    if importance is None:
        return work
    mask = load_importance(importance, *work.size, mask_name, memory.mask_factor(factor))
    return replace(work, importance=mask)


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
    release_memory()
    return replace(result, subject=settings.subject, why=work.why, history=tuple(history))


def _read(source: ImageSource) -> ImageSource:
    """The bytes of a file; pixels, and what is no image, as they are."""
    return source_bytes(source) if isinstance(source, (str, os.PathLike, bytes, Readable)) else source
