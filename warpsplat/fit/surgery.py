"""A turn of surgery: shapes and points that show little go, new shapes come where the error is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.fit.density import densify, least_seen, prune_mask
from warpsplat.fit.paints import choose_paints
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.schedule import mean_points_at, repaints_at, shapes_at
from warpsplat.fit.simplify import simplify
from warpsplat.fit.step import Step
from warpsplat.scene import Basis, FloatArray, Scene
from warpsplat.scene.geometry import areas


def operate(step: Step, *, grows: bool) -> Step:
    """Replace the shapes without which the error grows least; the step to go on with.

    ``grows``: whether the number of shapes and points follows the schedule; else it stays.
    """
    settings, state = step.settings, step.state
    step.renderer.forward_complete()
    seen = step.renderer.removal_costs(step.aim.target, step.aim.importance)
    if settings.paint != "flat" and repaints_at(settings, state.step):
        choose_paints(step)
    scene = state.scene()
    doomed = prune_mask(scene, settings.density, state.step / settings.iterations)
    doomed[: state.base] = False
    wanted = state.base + shapes_at(settings, state.step) if grows else len(scene)
    replaced = 0 if wanted < len(scene) else round(settings.density.replace * (len(scene) - state.base))
    rank = np.where(np.arange(len(scene)) < state.base, np.inf, seen)
    gone = least_seen(doomed, max(replaced, len(scene) - wanted), np.asarray(rank, np.float32))
    keep = np.setdiff1d(np.arange(len(scene)), gone)
    keep, added = renderer_of(settings.renderer).split(scene, keep, max(0, wanted - len(keep)))
    missing = wanted - len(keep) - len(added)
    if missing > 0:
        image = step.renderer.read_image()
        weights = step.target.weights
        new = densify(settings, scene, step.target.image, image, missing, state.rng, weights)
        added = added.append(new)
    if state.base:
        added = in_front(added, scene.take(np.arange(state.base)))
    state.parameters.rearrange(keep, added)
    if grows:
        _thin_outlines(step, seen[keep])
    if settings.order == "area":
        scene = state.scene()
        order = np.lexsort((-areas(scene), scene.layer))
        state.parameters.rearrange(order, scene.take(np.arange(0)))
    return step.after_surgery()


THIN_ROUNDS = 4
"""In which ``thin`` removes shapes: of two that hide each other neither is missed until the other is gone."""


def thin(step: Step, count: int) -> Step:
    """Remove shapes until ``count`` are left, those first without which the error grows least; the step to go
    on with, rendered. Shapes of earlier levels stay.
    """
    state = step.state
    for left in range(THIN_ROUNDS, 0, -1):
        excess = state.parameters.shape_count - count
        if excess <= 0:
            break
        step.render()
        seen = step.renderer.removal_costs(step.aim.target, step.aim.importance)
        seen[: state.base] = np.inf
        gone = np.argsort(seen, kind="stable")[: -(-excess // left)]
        nothing = state.scene().take(np.arange(0))
        state.parameters.rearrange(np.setdiff1d(np.arange(len(seen)), gone), nothing)
        step = step.after_surgery()
    step.render()
    step.measured_error()
    return step


def in_front(added: Scene, base: Scene) -> Scene:
    """New shapes as those of the level after ``base``, the shapes of earlier ones."""
    return replace(added, layer=np.full(len(added), int(base.layer.max()) + 1, np.int32))


def _thin_outlines(step: Step, seen: FloatArray) -> None:
    """Remove points of splines until they have as many in the mean as the schedule says.

    ``seen``: what the error would grow by without each shape, the first ones; newer ones keep their points.
    """
    state = step.state
    scene = state.scene()
    splines = scene.basis == Basis.SPLINE
    mean = mean_points_at(step.settings, state.step)
    excess = int(scene.point_counts()[splines].sum() - round(mean * int(splines.sum())))
    if excess <= 0:
        return
    # An outline is worth what its shape is worth by area.
    worth = np.full(len(scene), np.inf, np.float32)
    worth[: len(seen)] = np.maximum(seen, 0) / np.maximum(areas(scene)[: len(seen)], 1.0)
    state.parameters.reshape(*simplify(scene, worth, excess))
