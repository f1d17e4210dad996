"""A fit under way: how it begins, what its events ask, and its result."""

from __future__ import annotations

import contextlib
import math
import time
from dataclasses import replace

import numpy as np

from warpsplat.fit.budget import Budget
from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.densification import densify, recover, remove_surplus
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.palette import Palette
from warpsplat.fit.place import grid_scene
from warpsplat.fit.problem import USUAL_ROUNDING, Fit, Problem, Rounding, Run, Start
from warpsplat.fit.progress import Progress
from warpsplat.fit.rounding import choose_grid
from warpsplat.fit.saved import step_from
from warpsplat.fit.schedule import CHECK_INTERVAL, phase_at, phases, shapes_at, work_done
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.scene import Scene
from warpsplat.scene.geometry import most_seen
from warpsplat.svg.write import GRIDS


class Training:
    """A fit under way.

    What changes is ``step``, with its settings and state, which a checkpoint holds; and, where there is a
    deadline, ``budget``.
    """

    step: Step

    def __init__(self, problem: Problem, run: Run, start: Start, rounding: Rounding | None) -> None:
        self.image, self.given, self.loss = problem.target, problem.settings, problem.loss
        self.run, self.start = run, start
        self.rounds, self.rounding = rounding is not None, rounding or USUAL_ROUNDING
        self.palette = Palette.of(self.given, self.image)
        self.plan = phases(self.given, *problem.size)
        finest = Target(self.image, self.plan[-1]).image
        self.weights = pixel_weights(finest, problem.importance, self.given.texture)
        """Weights of the pixels at the finest size."""
        self.grows = start.scene is None or start.past is not None
        """Whether the number of shapes follows the schedule."""
        self.base = len(start.below) if start.below else 0
        self.budget = Budget(run.deadline)
        self.scene, self._rng = self._first_scene(self.given)
        """The shapes that the fit begins with, and its source of random numbers."""

    def _first_scene(self, settings: Settings) -> tuple[Scene, np.random.Generator]:
        start, rng = self.start, np.random.default_rng(settings.seed)
        scene = start.below or start.scene or grid_scene(settings, self.image, shapes_at(settings, 0), rng)
        canvas = self.palette.canvas(scene.canvas) if self.palette else scene.canvas
        return replace(scene, canvas=canvas), rng

    def begin(self) -> None:
        """Record the first step, or that after the state in the run's checkpoint."""
        begin, backend, checkpoint = self.start.begin, self.run.backend, self.run.checkpoint
        if checkpoint and checkpoint.state:
            self.step = step_from(checkpoint.state, self.scene, self.given, backend, self.target)
            return
        state, settings = self._first_state(), self.given
        if self.run.deadline < math.inf:
            settings = self.budget.measure(state, settings, self.image, self.loss)
            if shapes_at(settings, 0) != shapes_at(self.given, 0):  # no time for more shapes later
                self.scene, self._rng = self._first_scene(settings)
                state = self._first_state()
        if self.loss_at(settings, begin) is not self.loss:  # let its faults end the run now
            Step(state, settings, Target(self.image, self.plan[0], loss=self.loss)).measured_error()
        self.step = Step(state, settings, self.target(settings, begin))
        if self.start.below is not None:
            densify(self.step, grows=True)
        self.choose_colors()

    def _first_state(self) -> FitState:
        start = self.start
        return FitState.start(self.scene, self.run.backend, self._rng, start.begin, self.base, start.past)

    def target(self, settings: Settings, step: int) -> Target:
        """Return what the step after ``step`` steps is compared with."""
        phase, loss = phase_at(settings, self.plan, step), self.loss_at(settings, step)
        return Target(self.image, phase, self.weights, loss)

    def loss_at(self, settings: Settings, step: int) -> CustomLoss | None:
        """Return the user's own loss if it counts after ``step`` steps; if shapes were given, it does."""
        counts = self.loss and (not self.grows or self.loss.counts_at(step / settings.iterations))
        return self.loss if counts else None

    @property
    def settings(self) -> Settings:
        """The settings that were given, as they are adapted by now."""
        return self.step.settings

    @property
    def done(self) -> int:
        """Steps of the schedule that are done; those before the fit began count."""
        return self.step.state.step

    @property
    def is_over(self) -> bool:
        """Whether there is no further step."""
        return self.done >= self.settings.iterations

    @property
    def is_fine(self) -> bool:
        """Whether the last step was made at the finest size."""
        return self.step.target.phase is self.plan[-1]

    @property
    def missing(self) -> int:
        """Number of shapes that are missing from those of the file; a surplus is negative."""
        return self.base + self.settings.curves - self.step.state.parameters.shape_count if self.grows else 0

    def choose_colors(self) -> None:
        """Give each shape a colour of the palette, if there is one."""
        if self.palette:
            self.palette.choose(self.step)

    @property
    def densifies(self) -> bool:
        """Whether densification is not over yet."""
        return self.done < self.settings.density.stop * self.settings.iterations

    def plan_last_steps(self) -> None:
        """Plan the last steps, at the present size, and place shapes that are missing at once."""
        settings, missing = self.settings, self.missing > 0
        last = max(self.done + (CHECK_INTERVAL if missing else 1), self.start.begin + CHECK_INTERVAL)
        coarse = settings.coarse if self.is_fine else 1.0
        self.step.configure(replace(settings, iterations=min(last, settings.iterations), coarse=coarse))
        self.budget.costs.clear()
        if missing:
            densify(self.step, grows=True)

    def progress(self) -> Progress:
        """Return the state of the fit, for people."""
        settings, budget, begin = self.settings, self.budget, self.start.begin
        return Progress(
            self.done,
            settings.iterations,
            self.step.psnr(),
            seconds=time.monotonic() - self.run.started,
            work=budget.share() if budget.costs else work_done(settings, self.plan, self.done, begin),
            fine=self.is_fine,
            shapes=self.step.state.shape_count,
            snapshot=self.step.snapshot(),
        )

    def result(self, *, interrupted: bool) -> Fit:
        """Return the shapes as they are now."""
        step, state = self.step, self.step.state
        recover(step, replaces=False, last=True)
        if self.missing < 0:  # stopped before the surplus was pruned
            remove_surplus(step, self.base + self.settings.curves)
        if self.rounds and state.grid is None:
            state.grid = choose_grid(step, staged=False)
        render_psnr, estimated = step.render_psnr(), step.psnr()
        if not math.isfinite(estimated):  # of a step before numbers were reset
            estimated = render_psnr
        figures = (state.per_pixel, render_psnr, estimated, self.done - self.start.begin)
        return Fit(state.scene(), *figures, interrupted=interrupted, renewed=state.renewed)

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
            scene = most_seen(scene, self.base + self.given.curves, self.base)
        per_pixel = step.state.per_pixel if step else GRIDS[-1]
        return Fit(scene, per_pixel, math.nan, math.nan, done - begin, interrupted=True)
