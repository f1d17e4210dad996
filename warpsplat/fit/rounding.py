"""Rounding in stages: coordinates are rounded and frozen a third at a time, and the others refitted.

Rounded all at once, they cost several times as much error (docs/experiments.md).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warpsplat.fit.export import export, shown_image
from warpsplat.fit.problem import Rounding
from warpsplat.fit.settings import Settings
from warpsplat.portable import elementary
from warpsplat.scene import OPACITY_RANGE, Basis, Paint, Scene
from warpsplat.svg.write import GRIDS, resized, rounded

if TYPE_CHECKING:
    from warpsplat.fit.step import Step

STAGES, STAGE_SHARE = 3, 0.015
"""A third of the control points each (of cubics those on the outline, then the handles), or of the shapes of
forms; and the steps after each stage as a share of the run."""

MAX_LOSS, MAX_TRADED_LOSS = 0.03, 0.06
"""Maximum loss by rounding [dB], also where bytes are traded for error: beyond, refitting fails."""

STAGED_COST = 0.2
"""Cost of rounding in stages over that of rounding at once, measured."""

USUAL_GRID = 5.0
"""Units per pixel by which files are measured before the grid is chosen."""

OPACITY_BYTES, OPAQUE_COST = 10, 0.5
"""Mean bytes of a shape's opacity, as most shapes share a group that has it, and cost of making a shape
opaque after the others are refitted, over the cost at first."""

DB_PER_DOUBLING = 1.8
"""Gain from twice the shapes, and so twice the bytes, on photographs [dB] (docs/experiments.md)."""


def stage_steps(settings: Settings) -> int:
    """Return the number of steps after each stage."""
    return max(1, round(STAGE_SHARE * settings.iterations))


def stage_at(settings: Settings, step: int) -> int | None:
    """Return the stage, 1 to ``STAGES``, that is due after ``step`` steps, if any."""
    since = step - (settings.iterations - STAGES * stage_steps(settings))
    if since < 0 or since % stage_steps(settings):
        return None
    stage = 1 + since // stage_steps(settings)
    return stage if stage <= STAGES else None


def opacities_at(settings: Settings) -> int:
    """Return the number of steps after which opacities are frozen: densification is over, at full size."""
    share = max(settings.density.stop, settings.coarse)
    return min(round(share * settings.iterations) + 1, settings.iterations - STAGES * stage_steps(settings))


def finest(settings: Settings) -> float:
    """Return the units per pixel of the finest grid that the settings allow."""
    return GRIDS[-1] if settings.precision is None else elementary.power_of_ten(settings.precision)


def choose_grid(step: Step, *, staged: bool, rate_distortion: bool = False) -> float:
    """Return the units per pixel of the coarsest grid that costs less than ``MAX_LOSS``.

    If ``staged``, unrounded coordinates will be refitted. With ``rate_distortion``, return the grid with
    the least cost instead, which counts the file's bytes too.
    """
    state, renderer = step.state, step.renderer

    def error(scene: Scene) -> float:
        state.parameters.assign(scene)
        renderer.forward_complete()
        return step.objective.value()

    scene = state.scene()
    before = error(scene)
    refitted = STAGED_COST if staged else 1.0
    decibels = MAX_TRADED_LOSS if rate_distortion else MAX_LOSS
    allowed = abs(before) * float(elementary.power(10, decibels / 10) - 1) / refitted
    limit = finest(step.settings)
    grid, least, worth = limit, math.inf, 0.0
    if rate_distortion:
        worth = byte_worth(before, len(export(scene, step.settings, min(USUAL_GRID, limit))))
    for tried in [g for g in GRIDS if g < limit] + [limit]:
        loss = error(replace(scene, points=rounded(scene, tried).points)) - before
        size = len(export(scene, step.settings, tried)) if rate_distortion else 0
        cost = refitted * loss + worth * size
        if cost > least:
            break
        grid = tried
        if loss <= allowed:
            least = cost
            if not rate_distortion:
                break
    state.parameters.assign(scene)
    return grid


def freeze_opacities(step: Step) -> None:
    """Round opacities to tenths and freeze them; those that are worth less than their bytes become 1.

    With few different opacities, shapes can share a group that has them (``svg.order``).

    Making a shape of opacity o opaque costs D (1 - o)^2 / o^2, where D is its removal cost: the error is
    quadratic in the opacity, with its minimum at o.
    """
    parameters = step.state.parameters
    step.state.opacities_frozen = True
    if step.settings.opaque:
        return
    step.renderer.forward_complete()
    worth = np.maximum(step.objective.quadratic().removal_costs(), 0)
    scene = step.state.scene()
    cost = OPAQUE_COST * worth * ((1 - scene.opacities) / scene.opacities) ** 2
    size = len(export(scene, step.settings, min(USUAL_GRID, finest(step.settings))))
    opaque = cost < OPACITY_BYTES * byte_worth(step.objective.value(), size)
    tenths = np.clip(np.round(scene.opacities, 1), 0.1, OPACITY_RANGE[1])
    opacities = np.where(opaque, OPACITY_RANGE[1], tenths)
    opacities = np.where(scene.paint == Paint.PICTURE, scene.opacities, opacities)
    parameters.assign(replace(scene, opacities=opacities.astype(np.float32)))
    parameters.hold("opacities", np.ones(len(scene), np.bool_))


def round_stage(step: Step, rounding: Rounding) -> None:
    """Choose the grid before the first stage, and freeze the points of the stage that is due."""
    state, stage = step.state, stage_at(step.settings, step.state.step)
    if state.grid is None:
        state.grid = rounding.per_pixel or choose_grid(step, staged=True, rate_distortion=rounding.by_bytes)
    if stage is not None:
        freeze_stage(step, stage)


def freeze_stage(step: Step, stage: int) -> None:
    """Round and freeze all widths and the points that belong to the stages up to ``stage``."""
    parameters = step.state.parameters
    scene = step.state.scene()
    low = rounded(scene, step.state.per_pixel)
    shapes = np.repeat(np.arange(len(scene)), scene.point_counts())
    index = np.arange(len(scene.points)) - scene.first[shapes]
    index = np.where(scene.basis[shapes] > Basis.SPLINE, shapes, index)  # values are rounded together
    frozen = index % STAGES < stage
    points = np.where(frozen[:, None], low.points, scene.points)
    parameters.assign(replace(scene, points=points, widths=low.widths))
    parameters.hold("points", frozen)
    parameters.hold("widths", np.ones(len(scene), np.bool_))


def byte_worth(loss: float, size: float) -> float:
    """Return by how much the loss may grow for each byte saved of a file with ``size`` bytes.

    Shapes bought with that byte would lower the error as much: -d error / d size at ``DB_PER_DOUBLING``.
    """
    return abs(loss) * DB_PER_DOUBLING * elementary.LN10 / (10 * elementary.LN2 * size)


def evaluate_file(step: Step) -> None:
    """Subtract the difference between the file and the render from the loss target of the next steps.

    A viewer rounds coordinates, colours and, at each translucent layer, pixels. The difference changes little
    from step to step, so it is measured now and then: the loss is that of the file, its gradient that of the
    render (a straight-through estimator, Bengio et al. 2013).
    """
    step.render()
    viewport, image = step.target.viewport, step.target.image
    scene = step.state.scene()
    text = export(scene, step.settings, step.state.per_pixel)
    small = resized(text, viewport.width, viewport.height, viewport.scale)
    shown = shown_image(small, scene, image.shape[2])
    step.loss_target.assign(np.asarray(image - (shown - step.renderer.read_image()), np.float32))
