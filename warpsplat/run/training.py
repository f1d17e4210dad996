"""How the shapes of a run come to be: by a fit, in layers, for a goal, or traced."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, TypedDict

from warpsplat.drawing.subjects import draw
from warpsplat.fit.clear import clear_empty
from warpsplat.fit.costs import Course, score_cost
from warpsplat.fit.layered import fit_layered
from warpsplat.fit.loop import Fit, fit
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.settings import Settings
from warpsplat.fit.stages import Stages
from warpsplat.fit.work import Meter, Progress, Report
from warpsplat.native import release_memory
from warpsplat.rendering.backend import Backend
from warpsplat.run.figures import has_time_for_eyes, pixels_of
from warpsplat.scene import FloatArray
from warpsplat.search.goals import pursue
from warpsplat.search.several import Start
from warpsplat.svg.order import by_color, by_opacity


class Watching(TypedDict):
    """Who hears of a training, and who has a say in it."""

    report: Report | None
    after: float
    """Work that comes after it (``fit.costs``)."""
    stop: Callable[[], bool] | None
    stages: Stages | None


@dataclass(frozen=True)
class Training:
    """What shapes are made of, and who is told; see ``run.vectorize.vectorize``."""

    target: FloatArray
    settings: Settings
    backend: Backend
    metadata: str
    start: Start | None
    importance: FloatArray | None
    seconds: float | None
    """That it may take."""
    watching: Watching


Way = Literal["fit", "layers", "goal", "trace"]


def way_of(settings: Settings, start: Start | None) -> Way:
    """How the shapes that ``settings`` ask for are made."""
    if start is not None:
        return "fit"
    if settings.subject not in {"auto", "photo"}:
        return "trace"
    if settings.target_psnr or settings.max_bytes:
        return "goal"
    return "layers" if settings.levels else "fit"


def trained(run: Training, way: Way) -> Fit:
    """The shapes."""
    if way == "trace":
        return _by_trace(run)
    if way == "goal":
        return _by_goal(run)
    return _by_layers(run) if way == "layers" else _by_fit(run)


def _by_fit(run: Training) -> Fit:
    height, width = run.target.shape[:2]
    scene, past, begin = (run.start.scene, run.start.past, run.start.begin) if run.start else (None, None, 0)
    course, watching = Course.of(run.settings, width, height, run.backend, begin=begin), run.watching
    return fit(
        run.target,
        run.settings,
        run.backend,
        scene=scene,
        past=past,
        begin=begin,
        importance=run.importance,
        seconds=run.seconds,
        report=Meter(watching["report"], watching["after"]).stage(course.cost(), 0),
        stop=watching["stop"],
        stages=watching["stages"],
    )


def _by_layers(run: Training) -> Fit:
    return fit_layered(run.target, run.settings, run.backend, importance=run.importance, **run.watching)


def _by_goal(run: Training) -> Fit:
    return pursue(
        run.target,
        run.settings,
        run.backend,
        metadata=run.metadata,
        importance=run.importance,
        seconds=run.seconds,
        **run.watching,
    )


def _by_trace(run: Training) -> Fit:
    return draw(run.target, run.settings, run.backend, seconds=run.seconds, **run.watching)


def arranged(made: Fit, run: Training, way: Way) -> Fit:
    """What was made in the order in which the file says it, without what shows nothing."""
    settings = run.settings
    soft = renderer_of(settings.renderer).soft
    if way not in {"goal", "trace"} and not soft:
        made = replace(made, scene=made.scene.take(by_opacity(made.scene)))
    if run.target.shape[2] == 4 and way != "trace" and not made.interrupted:
        clear = clear_empty(made.scene, run.target, settings, run.backend, made.per_pixel)
        made = replace(made, scene=clear)
    if settings.ids and settings.subject != "line" and not soft:
        made = replace(made, scene=made.scene.take(by_color(made.scene)))
    return made


def training_seconds(settings: Settings, target: FloatArray, started: float) -> float | None:
    """What ``time_budget`` leaves for training, of a run that began at ``started`` (``time.monotonic``)."""
    if settings.time_budget is None:
        return None
    tail = TAIL_SECONDS + TAIL_PER_PIXEL * target.shape[0] * target.shape[1]
    return settings.time_budget - tail - (time.monotonic() - started)


TAIL_SECONDS = 0.3
TAIL_PER_PIXEL = 3e-7
"""Of a time budget: what the last step, exporting and scoring take [s]."""


def cost_after(settings: Settings, target: FloatArray, backend: Backend, way: Way) -> float:
    """Work that scoring takes (``fit.costs``)."""
    pixels, eyes = pixels_of(target), has_time_for_eyes(settings, target)
    shapes = settings.curves if way in {"fit", "layers"} else 0  # otherwise nobody knows how many
    whole = score_cost(pixels, shapes, backend, eyes=eyes)
    return whole + sum(score_cost(pixels, count, backend, eyes=False) for count in settings.levels)


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
