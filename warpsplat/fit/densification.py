"""Densification: every few steps shapes that matter least are replaced by new ones where the error is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.fit.grow import new_shapes
from warpsplat.fit.paints import choose_paints
from warpsplat.fit.prune import choose_removed, prune_mask
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.schedule import mean_points_at, repaints_at, shapes_at
from warpsplat.fit.simplify import simplify
from warpsplat.fit.step import Step
from warpsplat.scene import Basis, FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import areas

SURPLUS_ROUNDS = 4
"""Rounds in which ``remove_surplus`` removes shapes: of two that hide each other the costs are 0 until one is
gone."""


def densify(step: Step, *, grows: bool) -> Step:
    """Prune, grow and, by the settings, repaint and reorder the shapes; return the step for the new ones.

    ``grows``: whether the number of shapes and points follows the schedule; else it stays.
    """
    settings, state = step.settings, step.state
    step.renderer.forward_complete()
    costs = step.removal_costs()
    if settings.paint != "flat" and repaints_at(settings, state.step):
        choose_paints(step)
    scene = state.scene()
    wanted = state.base + shapes_at(settings, state.step) if grows else len(scene)
    keep = _kept(step, scene, costs, wanted)
    keep, added = renderer_of(settings.renderer).split(scene, keep, max(0, wanted - len(keep)))
    replace_shapes(step, scene, keep, added, wanted)
    if grows:
        _reduce_points(step, costs[keep])
    if settings.order == "area":
        scene = state.scene()
        order = np.lexsort((-areas(scene), scene.layer))
        state.parameters.rearrange(order, scene.take(np.arange(0)))
    return step.rebuilt()


def replace_shapes(step: Step, scene: Scene, keep: IndexArray, added: Scene, count: int) -> None:
    """Keep the shapes ``keep``, append ``added`` and new ones where the error is, until there are ``count``.

    With shapes of earlier levels in the scene, new ones belong to the level after these.
    """
    state, target = step.state, step.target
    missing = count - len(keep) - len(added)
    if missing > 0:
        image = step.renderer.read_image()
        new = new_shapes(step.settings, scene, target.image, image, missing, state.rng, target.weights)
        added = added.append(new)
    if state.base:
        layer = int(scene.layer[: state.base].max()) + 1
        added = replace(added, layer=np.full(len(added), layer, np.int32))
    state.parameters.rearrange(keep, added)


def remove_surplus(step: Step, count: int) -> Step:
    """Remove the shapes with the least removal costs until ``count`` are left, but none of earlier levels.

    Returns:
        the step for them, rendered.
    """
    state = step.state
    for rounds_left in range(SURPLUS_ROUNDS, 0, -1):
        excess = state.parameters.shape_count - count
        if excess <= 0:
            break
        step.render()
        costs = step.removal_costs()
        costs[: state.base] = np.inf
        removed = np.argsort(costs, kind="stable")[: -(-excess // rounds_left)]
        none = state.scene().take(np.arange(0))
        state.parameters.rearrange(np.setdiff1d(np.arange(len(costs)), removed), none)
        step = step.rebuilt()
    step.render()
    step.measured_error()
    return step


def _kept(step: Step, scene: Scene, costs: FloatArray, wanted: int) -> IndexArray:
    """Return the shapes that stay where ``wanted`` are to be there; all of earlier levels do."""
    settings, base = step.settings, step.state.base
    pruned = prune_mask(scene, settings.density, step.state.step / settings.iterations)
    pruned[:base] = False
    replaced = 0 if wanted < len(scene) else round(settings.density.replace * (len(scene) - base))
    ranked = costs.astype(np.float32)
    ranked[:base] = np.inf
    removed = choose_removed(pruned, max(replaced, len(scene) - wanted), ranked)
    return np.setdiff1d(np.arange(len(scene)), removed)


def _reduce_points(step: Step, costs: FloatArray) -> None:
    """Remove points of splines until their mean number is that of the schedule.

    ``costs``: removal costs of the first shapes; the others are new and keep their points.
    """
    state = step.state
    scene = state.scene()
    splines = scene.basis == Basis.SPLINE
    mean = mean_points_at(step.settings, state.step)
    excess = int(scene.point_counts()[splines].sum() - round(mean * int(splines.sum())))
    if excess <= 0:
        return
    # A change of an outline by an area costs what the shape is worth per area.
    worth = np.full(len(scene), np.inf, np.float32)
    worth[: len(costs)] = np.maximum(costs, 0) / np.maximum(areas(scene)[: len(costs)], 1.0)
    state.parameters.reshape(*simplify(scene, worth, excess))
