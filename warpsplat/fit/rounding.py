"""Rounding in stages: what a file rounds is rounded and held bit by bit, and the rest fitted anew in between.

Rounded all at once, coordinates cost several times as much (docs/experiments.md).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from warpsplat.fit.export import export
from warpsplat.fit.rate import byte_worth
from warpsplat.fit.settings import Settings
from warpsplat.fit.step import Step
from warpsplat.portable import elementary
from warpsplat.scene import OPACITY_RANGE, Paint, Scene
from warpsplat.svg.write import GRIDS, rounded

STAGES = 3
"""Of a third of the control points each: of cubics those on the outline, then the handles."""

STAGE_SHARE = 0.015
"""Steps after each stage, over those of the run."""

LOSS = 0.03
"""Most that rounding may cost [dB]."""

THRIFTY_LOSS = 0.06
"""Most that rounding may cost where it saves bytes that are worth more [dB]: beyond, refitting fails."""

STAGED = 0.2
"""What rounding in stages costs over what rounding at once does."""

USUAL_GRID = 5.0
"""Units a pixel, where the grid is not known yet."""

OPACITY_BYTES = 10
"""Of a translucent shape, over an opaque one, in the mean: most share a group."""

REFITTED = 0.5
"""What an opacity of 1 costs when the rest is fitted anew, over what it costs at first."""


def stage_steps(settings: Settings) -> int:
    """Steps after each stage."""
    return max(1, round(STAGE_SHARE * settings.iterations))


def stage_at(settings: Settings, step: int) -> int | None:
    """The stage that is due after ``step`` steps."""
    since = step - (settings.iterations - STAGES * stage_steps(settings))
    if since < 0 or since % stage_steps(settings):
        return None
    stage = 1 + since // stage_steps(settings)
    return stage if stage <= STAGES else None


def opacities_at(settings: Settings) -> int:
    """Steps after which the opacities are held: once shapes stay and the image is at its finest."""
    share = max(settings.density.stop, settings.coarse)
    return min(round(share * settings.iterations) + 1, settings.iterations - STAGES * stage_steps(settings))


def finest(settings: Settings) -> float:
    """Units a pixel of the finest grid that the settings allow."""
    return GRIDS[-1] if settings.precision is None else elementary.power_of_ten(settings.precision)


def choose_grid(step: Step, *, staged: bool, thrifty: bool = False) -> float:
    """Units a pixel of the coarsest grid that costs less than ``LOSS``.

    Args:
        step: with the scene.
        staged: whether what is not rounded yet will be fitted anew.
        thrifty: take the grid that costs least, the bytes of the file counted as well.
    """
    state, renderer = step.state, step.renderer

    def error(scene: Scene) -> float:
        state.parameters.assign(scene)
        renderer.forward_complete()
        return step.square_error()

    scene = state.scene()
    before = error(scene)
    after_refit = STAGED if staged else 1.0
    allowed = before * float(elementary.power(10, (THRIFTY_LOSS if thrifty else LOSS) / 10) - 1) / after_refit
    limit = finest(step.settings)
    grid, least = limit, math.inf
    worth = byte_worth(before, len(export(scene, step.settings, min(USUAL_GRID, limit)))) if thrifty else 0.0
    for tried in [g for g in GRIDS if g < limit] + [limit]:
        loss = error(replace(scene, points=rounded(scene, tried).points)) - before
        size = len(export(scene, step.settings, tried)) if thrifty else 0
        cost = after_refit * loss + worth * size
        if cost > least:
            break
        grid = tried
        if loss <= allowed:
            least = cost
            if not thrifty:
                break
    state.parameters.assign(scene)
    return grid


def hold_opacities(step: Step) -> None:
    """Round the opacities to tenths and hold them; those that are worth less than their bytes become 1.

    With few different ones, shapes can share a group that says it (``svg.order``).

    At its best opacity o, a shape that is worth D (the squared error without it over that with it) costs
    D (1 - o)^2 / o^2 if it is made opaque: the error is quadratic in the opacity.
    """
    parameters = step.state.parameters
    if step.settings.opaque:
        return
    step.renderer.forward_complete()
    worth = step.renderer.removal_costs(step.aim.target, step.aim.importance)
    scene = parameters.scene()
    cost = REFITTED * np.maximum(worth, 0) * ((1 - scene.opacities) / scene.opacities) ** 2
    size = len(export(scene, step.settings, min(USUAL_GRID, finest(step.settings))))
    opaque = cost < OPACITY_BYTES * byte_worth(step.square_error(), size)
    tenths = np.clip(np.round(scene.opacities, 1), 0.1, OPACITY_RANGE[1])
    opacities = np.where(opaque, OPACITY_RANGE[1], tenths)
    opacities = np.where(scene.paint == Paint.PICTURE, scene.opacities, opacities)
    parameters.assign(replace(scene, opacities=opacities.astype(np.float32)))
    parameters.hold("opacities", np.ones(len(scene), np.bool_))


def hold_stage(step: Step, stage: int) -> None:
    """Round the points that belong to ``stage`` (1 to ``STAGES``) and all widths, and hold them."""
    parameters = step.state.parameters
    scene = parameters.scene()
    low = rounded(scene, step.state.per_pixel)
    index = np.arange(len(scene.points)) - np.repeat(scene.first[:-1], scene.point_counts())
    held = index % STAGES < stage
    points = np.where(held[:, None], low.points, scene.points)
    parameters.assign(replace(scene, points=points, widths=low.widths))
    parameters.hold("points", held)
    parameters.hold("widths", np.ones(len(scene), np.bool_))
