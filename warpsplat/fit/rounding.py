"""Rounding in stages: what a file rounds is rounded and held bit by bit, and the rest fitted anew in between.

Rounded all at once, coordinates cost several times as much (docs/experiments.md).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.fit.settings import Settings
from warpsplat.fit.step import Step
from warpsplat.scene import OPACITY_RANGE, Scene
from warpsplat.svg.write import GRIDS, rounded

STAGES = 4
"""Opacities, then a third of the control points each: of cubics those on the outline, then the handles."""

STAGE_SHARE = 0.015
"""Steps after each stage, over those of the run."""

LOSS = 0.03
"""Most that rounding may cost [dB]."""

STAGED = 0.2
"""What rounding in stages costs over what rounding at once does."""

NEARLY_OPAQUE = 0.9
"""From here on an opacity is rounded to 1."""


def stage_steps(settings: Settings) -> int:
    """Steps after each stage."""
    return max(1, round(STAGE_SHARE * settings.iterations))


def stage_at(settings: Settings, step: int) -> int | None:
    """The stage that is due after ``step`` steps."""
    since = step - (settings.iterations - STAGES * stage_steps(settings))
    if since < 0 or since % stage_steps(settings):
        return None
    return min(since // stage_steps(settings), STAGES)


def finest(settings: Settings) -> float:
    """Units a pixel of the finest grid that the settings allow."""
    return GRIDS[-1] if settings.precision is None else 10.0**settings.precision


def choose_grid(step: Step, *, staged: bool) -> float:
    """Units a pixel of the coarsest grid that costs less than ``LOSS``.

    ``staged``: whether what is not rounded yet will be fitted anew.
    """
    state, renderer = step.state, step.renderer

    def error(scene: Scene) -> float:
        state.parameters.assign(scene)
        renderer.forward_complete()
        return step.square_error()

    scene = state.scene()
    before = error(scene)
    allowed = before * (10 ** (LOSS / 10) - 1) / (STAGED if staged else 1)
    limit = finest(step.settings)
    grid = limit
    for grid in [g for g in GRIDS if g < limit] + [limit]:
        if error(replace(scene, points=rounded(scene, grid).points)) <= before + allowed:
            break
    state.parameters.assign(scene)
    return grid


def hold_stage(step: Step, stage: int) -> None:
    """Round what belongs to ``stage``, and hold it from now on."""
    parameters, grid = step.state.parameters, step.state.per_pixel
    scene = parameters.scene()
    low = rounded(scene, grid)
    if stage == 0:
        opacities = np.where(scene.opacities >= NEARLY_OPAQUE, OPACITY_RANGE[1], low.opacities)
        parameters.assign(replace(scene, opacities=opacities.astype(np.float32)))
        parameters.hold("opacities", np.ones(len(scene), np.bool_))
        return
    index = np.arange(len(scene.points)) - np.repeat(scene.first[:-1], scene.point_counts())
    held = index % (STAGES - 1) < stage
    parameters.assign(replace(scene, points=np.where(held[:, None], low.points, scene.points)))
    parameters.hold("points", held)
