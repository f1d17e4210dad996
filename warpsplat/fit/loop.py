"""The training loop: shapes optimised against an image, with what happens between steps."""

from __future__ import annotations

import contextlib
import math
import time
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.errors import DeviceError
from warpsplat.fit.budget import Budget, affordable
from warpsplat.fit.checkpoint import Content, number
from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.densification import densify, recover, remove_surplus
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.palette import Palette
from warpsplat.fit.place import grid_scene
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.progress import Progress
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.rounding import (
    choose_grid,
    evaluate_file,
    freeze_opacities,
    freeze_stage,
    opacities_at,
    stage_at,
)
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
from warpsplat.fit.state import FitState, Past
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.compiler import compile_seconds
from warpsplat.rendering.failures import failures_of
from warpsplat.scene import Scene
from warpsplat.scene.arrays import from_arrays, to_arrays
from warpsplat.scene.geometry import most_seen
from warpsplat.svg.write import GRIDS


@dataclass(frozen=True, eq=False)
class Start:
    """Shapes that a fit starts from; by default new ones, as many as the settings ask for."""

    scene: Scene | None = None
    """Shapes to start from; their number is kept, unless ``past`` is given."""
    past: Past | None = None
    """Optimizer state of these shapes: with it their number follows the schedule."""
    begin: int = 0
    """Step of the schedule to start at."""
    below: Scene | None = None
    """Shapes of earlier levels, in front of which new ones are placed."""


@dataclass(frozen=True)
class Rounding:
    """How the coordinates of a fit are rounded for its file."""

    per_pixel: float | None = None
    """View box units per pixel; None: chosen by the shapes."""
    by_bytes: bool = False
    """Whether the choice weighs the error against the bytes, instead of allowing a small loss."""


def fit(
    problem: Problem, run: Run, start: Start | None = None, rounding: Rounding | None = Rounding()
) -> Fit:
    """Optimise shapes against an image.

    Args:
        problem: the image and settings.
        run: how the work is carried out. If its ``checkpoint`` holds this fit, it continues from there.
        start: shapes to start from.
        rounding: how coordinates are rounded; None: no file is made of the result, nothing is rounded.

    Raises:
        CheckpointError: the run's ``checkpoint`` holds something else than the state of this fit.
    """
    start = start or Start()
    training = _Training(problem, run, start, rounding)
    scene, rng = training.first_scene(problem.settings)
    checkpoint = run.checkpoint
    if checkpoint:
        checkpoint.begin()
        if checkpoint.result:
            with checkpoint.reading():
                return _fit_from(checkpoint.result, scene)
    try:
        with failures_of(run.backend.device):
            return _trained(training, scene, rng)
    except DeviceError as failure:
        kept = training.kept()
        if kept is None:
            raise
        run.failures.append(failure)
        return kept


def _trained(training: _Training, scene: Scene, rng: np.random.Generator) -> Fit:
    """Return the result of a fit that begins with ``scene``, or continues from the run's checkpoint."""
    run, checkpoint = training.run, training.run.checkpoint
    if checkpoint and checkpoint.state:
        with checkpoint.reading():
            training.resume(checkpoint.state, scene)
    else:
        training.begin(scene, rng)
    while True:
        interrupted = run.stopped()
        if checkpoint and not training.is_over():
            checkpoint.keep(lambda: step_content(training.step), now=interrupted)
        if interrupted or training.is_over():
            break
        training.adjust()
        training.advance()
    made = training.result()
    if checkpoint and training.is_over():
        checkpoint.finish(_fit_content(made))
    return replace(made, interrupted=interrupted)


class _Training:
    """A fit under way: steps, and what happens between them."""

    step: Step

    def __init__(self, problem: Problem, run: Run, start: Start, rounding: Rounding | None) -> None:
        self.image, self.settings, self.run = problem.target, problem.settings, run
        self.loss = problem.loss
        self.start, self.rounding = start, rounding
        self.palette = Palette.of(self.settings, self.image)
        self.plan = phases(self.settings, *problem.size)
        finest = Target(self.image, self.plan[-1]).image
        self.weights = pixel_weights(finest, problem.importance, self.settings.texture)
        """Weights of the pixels at the finest size."""
        self.grows = start.scene is None or start.past is not None
        """Whether the number of shapes follows the schedule."""
        self.base = len(start.below) if start.below else 0
        self.budget: Budget | None = None
        self.started, self.compiled = time.monotonic(), compile_seconds()

    def first_scene(self, settings: Settings) -> tuple[Scene, np.random.Generator]:
        """Return the shapes that a fit with these settings starts from, and its source of random numbers."""
        start, rng = self.start, np.random.default_rng(settings.seed)
        scene = start.below or start.scene or grid_scene(settings, self.image, shapes_at(settings, 0), rng)
        canvas = self.palette.canvas(scene.canvas) if self.palette else scene.canvas
        return replace(scene, canvas=canvas), rng

    def resume(self, content: Content, scene: Scene) -> None:
        """Continue from a saved state of a fit that began with ``scene``."""
        begin, backend = self.start.begin, self.run.backend
        self.step = step_from(content, scene, self.settings, backend, self.base, begin, self.target)

    def begin(self, scene: Scene, rng: np.random.Generator) -> None:
        """Make the first step."""
        begin, settings = self.start.begin, self.settings
        state = self._state(scene, rng)
        if self.run.deadline < math.inf:
            self.budget = Budget(self.run.deadline)
            settings = self.budget.measure(state, settings, self.image, self.loss)
            if shapes_at(settings, 0) != shapes_at(
                self.settings, 0
            ):  # there is no time for shapes to come later
                state = self._state(*self.first_scene(settings))
        self.started, self.compiled = time.monotonic(), compile_seconds()
        if self.loss_at(settings, begin) is not self.loss:  # let its faults end the run now
            Step(state, settings, Target(self.image, self.plan[0], loss=self.loss)).measured_error()
        step = Step(state, settings, self.target(settings, begin))
        self.step = densify(step, grows=True) if self.start.below is not None else step
        self.advance()

    def _state(self, scene: Scene, rng: np.random.Generator) -> FitState:
        start = self.start
        return FitState.start(scene, self.run.backend, rng, start.begin, self.base, start.past)

    def target(self, settings: Settings, step: int) -> Target:
        """Return what the step after ``step`` steps is compared with."""
        phase, loss = phase_at(settings, self.plan, step), self.loss_at(settings, step)
        return Target(self.image, phase, self.weights, loss)

    def loss_at(self, settings: Settings, step: int) -> CustomLoss | None:
        """Return the user's own loss if it counts after ``step`` steps; if shapes were given, it does."""
        counts = self.loss and (not self.grows or self.loss.counts_at(step / settings.iterations))
        return self.loss if counts else None

    def is_over(self) -> bool:
        """Return whether there is no further step."""
        return self.step.state.step >= self.step.settings.iterations

    def advance(self) -> None:
        """Make a step, and report it where that is due."""
        step, settings = self.step, self.step.settings
        state = step.state
        before, begins = step, self.loss_at(settings, state.step) is not step.target.loss
        if begins or phase_at(settings, self.plan, state.step) is not step.target.phase:
            self.step = step = Step(state, settings, self.target(settings, state.step))
        if begins:
            state.parameters.scale_moments(step.slope() / max(before.slope(), 1e-12))
        if self.palette and not state.rounding and self.palette.is_due(state):
            self.palette.choose(step)
        step.advance()
        self._recover()
        if state.step % CHECK_INTERVAL == 0 or state.step == settings.iterations:
            self.step.ensure_capacity()
            if self.run.on_progress:
                self.run.report(self.progress())

    def _recover(self) -> None:
        """Reset shapes with non-finite numbers, where that is due."""
        step, settings, done = self.step, self.step.settings, self.step.state.step
        if self._is_due() or done % CHECK_INTERVAL == 0 or stage_at(settings, done) is not None:
            densifies = done < settings.density.stop * settings.iterations
            self.step = recover(step, replaces=self.grows and densifies)

    def _is_due(self) -> bool:
        """Return whether a densification step is due."""
        interval = self.step.settings.density.interval
        return interval > 0 and self.step.state.step % interval == 0

    def progress(self) -> Progress:
        """Return the state of the fit, for people."""
        step, done = self.step, self.step.state.step
        settings, now = step.settings, time.monotonic()
        if self.budget:
            work = min((now - self.started) / max(self.budget.deadline - self.started, 1e-9), 1.0)
        else:
            work = work_done(settings, self.plan, done, self.start.begin)
        fine = step.target.phase is self.plan[-1]
        seconds, shapes, snapshot = now - self.run.started, step.state.shape_count, step.snapshot()
        return Progress(done, settings.iterations, step.psnr(), seconds, work, fine, shapes, snapshot)

    def adjust(self) -> None:
        """Do what is due after the steps so far: rounding, an evaluation of the file, densification.

        If the time is up, the last steps are planned.
        """
        short = bool(self.budget and self.budget.over()) and self._end()
        step = self.step
        state, settings, done = step.state, step.settings, step.state.step
        if self.rounding:
            self._round(self.rounding)
        # A viewer may show kept elements differently from the start: they blend with what lies below.
        blends = bool(self.start.scene and self.start.scene.pictures)
        late = blends or done >= EVALUATE_FROM * settings.iterations
        evaluates = settings.viewer and self.rounding and step.target.phase is self.plan[-1] and late
        if evaluates and not state.rounding and done % EVALUATE_INTERVAL == 0:
            evaluate_file(step)
        due = self._is_due() or short
        if due:
            self._fit_goals()
        settings = step.settings
        missing = self.grows and state.parameters.shape_count != state.base + settings.curves
        densifies = missing or done < settings.density.stop * settings.iterations
        if due and done < settings.iterations and densifies:
            self.step = densify(step, grows=self.grows)
        elif done % EVALUATE_INTERVAL == 0:
            state.scene()  # so that the host knows it, whatever happens to the device

    def _end(self) -> bool:
        """Plan the last steps, at the present size; return whether shapes are missing, to be placed now."""
        step, self.budget = self.step, None
        state, settings = step.state, step.settings
        missing = self.grows and state.parameters.shape_count < state.base + settings.curves
        last = max(state.step + (CHECK_INTERVAL if missing else 1), self.start.begin + CHECK_INTERVAL)
        coarse = settings.coarse if step.target.phase is self.plan[-1] else 1.0
        step.configure(replace(settings, iterations=min(last, settings.iterations), coarse=coarse))
        return missing

    def _round(self, rounding: Rounding) -> None:
        """Round and hold what is due after the steps so far."""
        step = self.step
        state, settings = step.state, step.settings
        stage = stage_at(settings, state.step)
        if stage is not None:
            if not state.rounding:
                state.per_pixel = rounding.per_pixel or choose_grid(
                    step, staged=True, rate_distortion=rounding.by_bytes
                )
                state.rounding = True
            freeze_stage(step, stage)
        settles = renderer_of(settings.renderer).exact and not state.opacities_frozen
        if settles and state.step >= max(opacities_at(settings), self.start.begin + 1):
            freeze_opacities(step)
            state.opacities_frozen = True

    def _fit_goals(self) -> None:
        """Adapt the settings to the time left, and to the bytes of the shapes, while shapes may change."""
        step = self.step
        settings, done = step.settings, step.state.step
        if done >= settings.density.stop * settings.iterations:
            return
        if self.budget and step.target.phase is self.plan[0]:  # later the schedule stays as it is
            worked = time.monotonic() - self.started - (compile_seconds() - self.compiled)
            slowness = worked / (done * self.budget.costs[0])
            step.configure(self.budget.fit(settings, done, slowness))
        if self.grows and settings.max_bytes:
            step.configure(affordable(step))

    def result(self) -> Fit:
        """Return the shapes as they are now, as the result of an uninterrupted fit."""
        self.step = step = recover(self.step, replaces=False, last=True)
        state, most = step.state, step.state.base + step.settings.curves
        if self.grows and state.parameters.shape_count > most:  # stopped before the surplus was pruned
            self.step = step = remove_surplus(step, most)
        if self.rounding and not state.rounding:
            state.per_pixel = choose_grid(step, staged=False)
        done, render_psnr, estimated = state.step - self.start.begin, step.render_psnr(), step.psnr()
        if not math.isfinite(estimated):  # of a step before numbers were reset
            estimated = render_psnr
        return Fit(
            state.scene(),
            state.per_pixel,
            render_psnr,
            estimated,
            done,
            interrupted=False,
            renewed=state.renewed,
        )

    def kept(self) -> Fit | None:
        """Return the last shapes that can be had after the device failed; None: there are none yet."""
        begin, below, step = self.start.begin, self.start.below, getattr(self, "step", None)
        known = begin, below if below is not None else self.start.scene
        if step:
            state = step.state
            with contextlib.suppress(RuntimeError):  # the device's memory may be lost
                if not state.known or state.known[0] < state.step:  # else shapes may be half replaced
                    now = state.parameters.scene()
                    state.known = (state.step, now) if now.is_finite else state.known
            if state.known and state.known[0] > begin:
                known = state.known
        done, scene = known
        if scene is None:
            return None
        if self.grows:
            scene = most_seen(scene, self.base + self.settings.curves, self.base)
        per_pixel = step.state.per_pixel if step else GRIDS[-1]
        return Fit(scene, per_pixel, math.nan, math.nan, done - begin, interrupted=True)


def work_done(settings: Settings, plan: list[Phase], step: int, begin: int = 0) -> float:
    """Return the share of a fit's work that is done after ``step`` steps, if it began at the step ``begin``.

    A step counts by the side length of its image: its time grows about with the outlines, not the areas.
    """
    change = settings.coarse * settings.iterations if len(plan) > 1 else 0.0
    coarse, fine = (math.sqrt(phase.width * phase.height) for phase in (plan[0], plan[-1]))

    def work(until: float) -> float:
        return coarse * min(until, change) + fine * max(until - change, 0.0)

    return (work(step) - work(begin)) / (work(settings.iterations) - work(begin))


SAVED_LIMIT = 1e9
"""Largest figure that is read from a checkpoint."""

SAVED = {"per_pixel": float, "render_psnr": float, "estimated_psnr": float, "iterations": int, "renewed": int}
"""Figures of a fit that a checkpoint holds."""


def _fit_content(made: Fit) -> Content:
    """Return a result as numbers and arrays."""
    return Content({name: kind(getattr(made, name)) for name, kind in SAVED.items()}, to_arrays(made.scene))


def _fit_from(content: Content, start: Scene) -> Fit:
    """Return the result of a fit that began with ``start``."""
    figures = {
        name: number(content.numbers, name, kind, -SAVED_LIMIT, SAVED_LIMIT) for name, kind in SAVED.items()
    }
    return Fit(from_arrays(content.arrays, start), interrupted=False, **figures)
