"""The loop of a run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.fit.afford import affordable
from warpsplat.fit.budget import Budget
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.mend import mend
from warpsplat.fit.palette import Palette
from warpsplat.fit.place import grid_scene
from warpsplat.fit.rounding import choose_grid, hold_opacities, hold_stage, opacities_at, stage_at
from warpsplat.fit.schedule import (
    CHECK_INTERVAL,
    LOOK_FROM,
    LOOK_INTERVAL,
    phase_at,
    phases,
    shapes_at,
    work_done,
)
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.fit.surgery import operate
from warpsplat.fit.viewer_shift import look_at_file
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Scene


@dataclass(frozen=True)
class Progress:
    """State of a run between two steps."""

    step: int
    """Steps done."""
    steps: int
    """Steps in all."""
    psnr: float
    """Of the internal render at the current training size [dB]."""
    seconds: float
    """Since the start of the training."""
    work: float
    """Share of the run's work that is done, 0 to 1: a step counts by what its size makes it cost."""
    fine: bool
    """Whether the size is the finest: on a reduced image the same shapes have more decibels."""


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
    per_pixel: float | None = None,
    thrifty: bool = False,
    finish: bool = True,
    importance: FloatArray | None = None,
    seconds: float | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Fit:
    """Optimise shapes against ``image``.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3).
        settings: all that decides the result.
        backend: where to compute.
        scene: shapes to start from, whose number stays; without, new ones.
        below: shapes of earlier levels, that the settings' number of new ones are put in front of.
        finish: whether a file is made of the result; else nothing is rounded for it.
        begin: step of the schedule to start at.
        per_pixel: units of the view box a pixel; without, they are chosen.
        thrifty: whether to choose those that are worth their bytes, rather than some that lose little.
        importance: how much the error of a pixel counts: grey mask in [0, 1], of any size.
        seconds: time that the run should take, in place of the settings' iterations.
        report: called every few steps.
        stop: asked after every step; once true, the run ends.
    """
    rng = np.random.default_rng(settings.seed)
    grows = scene is None
    start = below or scene or grid_scene(settings, image, shapes_at(settings, 0), rng)
    palette = Palette.of(settings, image)
    if palette:
        start = replace(start, canvas=palette.canvas(start.canvas))
    state = FitState.start(start, backend, rng, begin, len(below) if below else 0)
    budget = Budget(seconds) if seconds is not None else None
    if budget:
        settings = budget.measure(state, settings, image)
    started = time.monotonic()
    plan = phases(settings, image.shape[1], image.shape[0])
    weights = pixel_weights(Target(image, plan[-1]).image, importance, settings.texture)
    step: Step | None = None
    phase = None
    interrupted = False
    settled = rounding = False
    while True:
        entered = phase_at(settings, plan, state.step)
        if step is None or entered is not phase:
            phase = entered
            first = step is None and below is not None
            step = Step(state, settings, Target(image, phase, weights))
            step = operate(step, grows=True) if first else step
        if palette and not rounding and palette.is_due(state):
            palette.choose(step)
        step.advance()
        done, finest = state.step, phase is plan[-1]
        density = settings.density
        surgical = done < density.stop * settings.iterations
        due = density.interval > 0 and done % density.interval == 0
        stage = stage_at(settings, done)
        if due or done % CHECK_INTERVAL == 0 or stage is not None:  # before the values are looked at
            step = mend(step, renews=grows and surgical)
        if done % CHECK_INTERVAL == 0 or done == settings.iterations:
            step.make_room()
            if report:
                spent, work = time.monotonic() - started, work_done(settings, plan, done)
                report(Progress(done, settings.iterations, step.psnr(), spent, work, finest))
        if stop and stop():
            interrupted = True
            break
        if done >= settings.iterations or (budget and budget.over()):
            break
        if stage is not None and finish:
            if not rounding:
                state.per_pixel = per_pixel or choose_grid(step, staged=True, thrifty=thrifty)
                rounding = True
            hold_stage(step, stage)
        exact = settings.renderer == "exact"
        if finish and exact and not settled and done >= max(opacities_at(settings), begin + 1):
            hold_opacities(step)
            settled = True
        # What is kept may show other than over what lies below.
        late = done >= LOOK_FROM * settings.iterations or bool(start.pictures)
        if settings.viewer and finish and finest and late and not rounding and done % LOOK_INTERVAL == 0:
            look_at_file(step)
        if due and budget and phase is plan[0] and surgical:  # then what is due when stays as it is
            slowness = (time.monotonic() - started) / (done * budget.costs[0])
            settings = budget.fit(settings, done, slowness)
            step.configure(settings)
        if due and grows and settings.max_bytes and surgical:
            settings = affordable(step)
            step.configure(settings)
        missing = grows and state.parameters.shape_count != state.base + settings.curves
        if due and done < settings.iterations and (missing or done < density.stop * settings.iterations):
            step = operate(step, grows=grows)
    step = mend(step, renews=False, last=True)
    if finish and not rounding:
        state.per_pixel = choose_grid(step, staged=False)
    done = state.step - begin
    render_psnr, estimated = step.render_psnr(), step.psnr()
    if not math.isfinite(estimated):  # of a step before the last mending
        estimated = render_psnr
    return Fit(state.scene(), state.per_pixel, render_psnr, estimated, done, interrupted, state.renewed)
