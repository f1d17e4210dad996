"""A turn of surgery: shapes that show little go, new ones come where the error is."""

from __future__ import annotations

import numpy as np

from warpsplat.fit.density import densify, least_seen, prune_mask
from warpsplat.fit.schedule import shapes_at
from warpsplat.fit.step import Step
from warpsplat.scene.geometry import areas


def operate(step: Step, *, grows: bool) -> Step:
    """Replace the shapes without which the error grows least; the step to go on with.

    ``grows``: whether the number of shapes follows the schedule; else it stays.
    """
    settings, state = step.settings, step.state
    step.renderer.forward_complete()
    scene = state.scene()
    doomed = prune_mask(scene, settings.density, state.step / settings.iterations)
    seen = step.renderer.removal_costs(step.aim.target, step.aim.importance)
    gone = least_seen(doomed, round(settings.density.replace * len(scene)), seen)
    keep = np.setdiff1d(np.arange(len(scene)), gone)
    count = max(len(scene), shapes_at(settings, state.step) if grows else 0) - len(keep)
    if count:
        image = step.renderer.read_image()
        added = densify(settings, scene, step.target.image, image, count, state.rng, step.target.weights)
        state.parameters.rearrange(keep, added)
    if settings.order == "area":
        scene = state.scene()
        order = np.argsort(-areas(scene), kind="stable")
        state.parameters.rearrange(order, scene.take(np.arange(0)))
    return step.after_surgery()
