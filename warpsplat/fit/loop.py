"""The loop of a run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from warpsplat.fit.afford import affordable
from warpsplat.fit.budget import Budget
from warpsplat.fit.costs import Course, serial
from warpsplat.fit.densification import densify, remove_surplus
from warpsplat.fit.evaluate_file import evaluate_file
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.palette import Palette
from warpsplat.fit.place import grid_scene
from warpsplat.fit.recover import recover
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.rounding import choose_grid, freeze_opacities, freeze_stage, opacities_at, stage_at
from warpsplat.fit.saved import step_content, step_from
from warpsplat.fit.schedule import (
    CHECK_INTERVAL,
    EVALUATE_FROM,
    EVALUATE_INTERVAL,
    Phase,
    phase_at,
    phases,
    shapes_at,
)
from warpsplat.fit.settings import Settings
from warpsplat.fit.stages import Content, Stages, real, whole
from warpsplat.fit.state import FitState, Past
from warpsplat.fit.step import Step, Target
from warpsplat.fit.work import Progress
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.arrays import from_arrays, to_arrays
from warpsplat.scene.scene import level_ends


@dataclass(frozen=True)
class Fit:
    """What a run made."""

    scene: Scene
    per_pixel: float
    """Units of the view box a pixel that the scene is rounded to, or may be."""
    render_psnr: float
    """Of the last training render, at its size [dB]."""
    estimated_psnr: float
    """What the last step's loss stands for [dB]: from the first look at the file on, the file."""
    iterations: int
    """Steps done."""
    interrupted: bool
    renewed: int = 0
    """Times that a shape was set anew since a number of its was not finite."""


def fit(
    image: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    scene: Scene | None = None,
    below: Scene | None = None,
    begin: int = 0,
    past: Past | None = None,
    per_pixel: float | None = None,
    thrifty: bool = False,
    finish: bool = True,
    importance: FloatArray | None = None,
    seconds: float | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    stages: Stages | None = None,
) -> Fit:
    """Optimise shapes against ``image``.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3).
        settings: all that decides the result.
        backend: where to compute.
        scene: shapes to start from, whose number stays unless they have a ``past``; without, new ones.
        below: shapes of earlier levels, that the settings' number of new ones are put in front of.
        finish: whether a file is made of the result; else nothing is rounded for it.
        begin: step of the schedule to start at.
        past: what another fit's optimizer knows of the shapes of ``scene``: with it their number follows the
            schedule, as in a fit that came to this step itself.
        per_pixel: units of the view box a pixel; without, they are chosen.
        thrifty: whether to choose those that are worth their bytes, rather than some that lose little.
        importance: how much the error of a pixel counts: grey mask in [0, 1], of any size.
        seconds: time that the run should take, in place of the settings' iterations.
        report: called every few steps.
        stop: asked after every step; once true, the run ends.
        stages: of which this is the next fit: where an earlier run came to it, it goes on from there. None
            for a run of some ``seconds``, of which no two take the same steps.

    Raises:
        CheckpointError: ``stages`` hold what cannot be the state of this fit.
    """
    rng = np.random.default_rng(settings.seed)
    start = below or scene or grid_scene(settings, image, shapes_at(settings, 0), rng)
    palette = Palette.of(settings, image)
    if palette:
        start = replace(start, canvas=palette.canvas(start.canvas))
    stage = stages.begin() if stages else None
    if stage and stage.result:
        with stage.reading():
            return _fit_from(stage.result, start)
    plan = phases(settings, image.shape[1], image.shape[0])
    weights = pixel_weights(Target(image, plan[-1]).image, importance, settings.texture)
    ends = (*level_ends(below), len(below)) if below else ()
    grows = scene is None or past is not None
    task = _Task(
        image,
        start,
        plan,
        weights,
        palette,
        begin,
        per_pixel,
        grows,
        thrifty,
        finish,
        report,
        seconds,
        ends,
    )
    base, budget = len(below) if below else 0, None
    if stage and stage.state:
        with stage.reading():
            run = _Run(task, step_from(stage.state, start, settings, backend, base, begin, task.target))
    else:
        state = FitState.start(start, backend, rng, begin, base, past)
        if seconds is not None:
            budget = Budget(seconds)
            settings = budget.measure(state, settings, image)
        task = replace(task, started=time.monotonic())
        step = Step(state, settings, task.target(settings, begin))
        run = _Run(task, densify(step, grows=True) if below is not None else step, budget)
        run.advance()
    while True:
        interrupted = bool(stop and stop())
        if stage and not run.is_over():
            stage.keep(lambda: step_content(run.step), now=interrupted)
        if interrupted or run.is_over():
            break
        run.turn()
        run.advance()
    made = run.result()
    if stage and run.is_over():
        stage.finish(_fit_content(made))
    return replace(made, interrupted=interrupted)


@dataclass(frozen=True)
class _Task:
    """What a fit is to do, besides its settings; see ``fit``."""

    image: FloatArray
    start: Scene
    plan: list[Phase]
    weights: FloatArray | None
    """Of the pixels at the finest size."""
    palette: Palette | None
    begin: int
    per_pixel: float | None
    grows: bool
    """Whether the number of shapes follows the schedule."""
    thrifty: bool
    finish: bool
    report: Callable[[Progress], None] | None
    seconds: float | None
    ends: tuple[int, ...]
    """Shapes up to the end of each earlier level."""
    started: float = field(default_factory=time.monotonic)

    def target(self, settings: Settings, step: int) -> Target:
        """What the step after ``step`` steps compares with."""
        return Target(self.image, phase_at(settings, self.plan, step), self.weights)


class _Run:
    """A fit between a step and what may follow it before the next one: a turn."""

    def __init__(self, task: _Task, step: Step, budget: Budget | None = None) -> None:
        self.task, self.step, self.budget = task, step, budget

    def is_over(self) -> bool:
        """Whether there is no further step."""
        done = self.step.state.step >= self.step.settings.iterations
        return done or bool(self.budget and self.budget.over())

    def advance(self) -> None:
        """A step."""
        step, task, settings = self.step, self.task, self.step.settings
        state = step.state
        if phase_at(settings, task.plan, state.step) is not step.target.phase:
            self.step = step = Step(state, settings, task.target(settings, state.step))
        if task.palette and not state.rounding and task.palette.is_due(state):
            task.palette.choose(step)
        step.advance()
        self._mend()
        if state.step % CHECK_INTERVAL == 0 or state.step == settings.iterations:
            self.step.ensure_capacity()
            if task.report:
                task.report(self.progress())

    def _mend(self) -> None:
        """Find numbers that are not finite, before the values are looked at."""
        step, settings, done = self.step, self.step.settings, self.step.state.step
        if self._is_due() or done % CHECK_INTERVAL == 0 or stage_at(settings, done) is not None:
            surgical = done < settings.density.stop * settings.iterations
            self.step = recover(step, replaces=self.task.grows and surgical)

    def _is_due(self) -> bool:
        """Whether it is time for surgery."""
        interval = self.step.settings.density.interval
        return interval > 0 and self.step.state.step % interval == 0

    def progress(self) -> Progress:
        """For people."""
        step, task, done = self.step, self.task, self.step.state.step
        settings, spent = step.settings, time.monotonic() - task.started
        course = Course(
            settings,
            task.plan,
            task.begin,
            task.ends,
            finish=task.finish,
            thrifty=task.thrifty and not task.per_pixel,
            serial=serial(step.state.parameters.backend),
        )
        work = min(spent / task.seconds, 1.0) if task.seconds else course.cost(done) / course.cost()
        fine = step.target.phase is task.plan[-1]
        shapes, now = step.state.shape_count, step.snapshot()
        return Progress(done, settings.iterations, step.psnr(), spent, work, fine, shapes, now)

    def turn(self) -> None:
        """What is due after the steps so far: rounding, a look at the file, surgery."""
        task, step = self.task, self.step
        state, settings, done = step.state, step.settings, step.state.step
        if task.finish:
            self._round()
        # What is kept may show other than over what lies below.
        late = done >= EVALUATE_FROM * settings.iterations or bool(task.start.pictures)
        looks = settings.viewer and task.finish and step.target.phase is task.plan[-1] and late
        if looks and not state.rounding and done % EVALUATE_INTERVAL == 0:
            evaluate_file(step)
        due = self._is_due()
        if due:
            self._fit_goals()
        settings = step.settings
        missing = task.grows and state.parameters.shape_count != state.base + settings.curves
        surgical = missing or done < settings.density.stop * settings.iterations
        if due and done < settings.iterations and surgical:
            self.step = densify(step, grows=task.grows)

    def _round(self) -> None:
        """Round and hold what the steps so far ask for."""
        task, step = self.task, self.step
        state, settings = step.state, step.settings
        stage = stage_at(settings, state.step)
        if stage is not None:
            if not state.rounding:
                state.per_pixel = task.per_pixel or choose_grid(
                    step, staged=True, rate_distortion=task.thrifty
                )
                state.rounding = True
            freeze_stage(step, stage)
        settles = renderer_of(settings.renderer).exact and not state.opacities_frozen
        if settles and state.step >= max(opacities_at(settings), task.begin + 1):
            freeze_opacities(step)
            state.opacities_frozen = True

    def _fit_goals(self) -> None:
        """Settings by the time that is left, and by the bytes that the shapes take, until they stay."""
        task, step = self.task, self.step
        settings, done = step.settings, step.state.step
        if done >= settings.density.stop * settings.iterations:
            return
        if self.budget and step.target.phase is task.plan[0]:  # then what is due when stays as it is
            slowness = (time.monotonic() - self.task.started) / (done * self.budget.costs[0])
            step.configure(self.budget.fit(settings, done, slowness))
        if task.grows and settings.max_bytes:
            step.configure(affordable(step))

    def result(self) -> Fit:
        """What there is now, as that of a run that was not interrupted."""
        self.step = step = recover(self.step, replaces=False, last=True)
        state, most = step.state, step.state.base + step.settings.curves
        if self.task.grows and state.parameters.shape_count > most:  # it was ended while it had a surplus
            self.step = step = remove_surplus(step, most)
        if self.task.finish and not state.rounding:
            state.per_pixel = choose_grid(step, staged=False)
        done, render_psnr, estimated = state.step - self.task.begin, step.render_psnr(), step.psnr()
        if not math.isfinite(estimated):  # of a step before the last mending
            estimated = render_psnr
        return Fit(
            state.scene(),
            state.per_pixel,
            render_psnr,
            estimated,
            done,
            interrupted=False,
            renewed=state.recovered,
        )


MOST = 1_000_000_000
"""Of a figure that is read."""

FIGURES = ("per_pixel", "render_psnr", "estimated_psnr")


def _fit_content(made: Fit) -> Content:
    """A result as numbers and arrays."""
    numbers = {name: getattr(made, name) for name in (*FIGURES, "iterations", "renewed")}
    return Content(numbers, to_arrays(made.scene))


def _fit_from(content: Content, start: Scene) -> Fit:
    """The result of a fit that began with ``start``."""
    figures = {name: real(content.numbers, name, -MOST, MOST) for name in FIGURES}
    iterations, renewed = (whole(content.numbers, name, 0, MOST) for name in ("iterations", "renewed"))
    scene = from_arrays(content.arrays, start)
    return Fit(scene, iterations=iterations, interrupted=False, renewed=renewed, **figures)
