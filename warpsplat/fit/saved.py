"""A fit between two steps, or its result, as a checkpoint holds it; a resumed fit gives the same bits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np

from warpsplat.fit.checkpoint import Content
from warpsplat.fit.problem import Fit
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState, Past
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity
from warpsplat.rendering.tiles import from_tiles
from warpsplat.scene import ATTRIBUTES, Scene
from warpsplat.scene.attributes import TRAITS

LAYOUT = ("kind", "basis", "first", "starts", "closed", "stop_first")
"""Arrays that give the rows of the others their meaning."""

FIGURES = ("per_pixel", "render_psnr", "estimated_psnr", "iterations", "renewed")
"""Fields of a ``Fit`` that are saved beside its scene."""


def step_content(step: Step) -> Content:
    """Return everything that ``step`` carries to the next one, copied to the host."""
    state, parameters, target = step.state, step.state.parameters, None
    if step.loss_target.changed:
        viewport = step.target.viewport
        target = from_tiles(step.loss_target.target.numpy(), viewport.width, viewport.height)
    return {
        "step": state.step,
        "base": state.base,
        "began": step.began,
        "curves": step.settings.curves,
        "grid": state.grid,
        "settled": state.opacities_frozen,
        "renewed": state.renewed,
        "colored": state.colored == parameters.revision,
        "generator": state.rng.bit_generator.state,
        "room": [[asdict(sizes) for sizes in renderer.capacity_and_need()] for renderer in step.renderers],
        "shapes": _shapes(parameters.scene()),
        "moments": parameters.moments(),
        "ages": parameters.arrays["ages"].numpy(),
        "held": {name: group.held.numpy() for name, group in parameters.groups.items()},
        # Computed at surgery only, so these may differ from what the current values would give.
        "circular": parameters.arrays["circular"].numpy() if parameters.has_circles else None,
        "target": target,
    }


def step_from(
    saved: Content,
    start: Scene,
    settings: Settings,
    backend: Backend,
    target: Callable[[Settings, int], Target],
) -> Step:
    """Return the step that ``step_content`` saved.

    The fit began with the scene ``start`` and ``settings``; ``target`` returns the target of the step after a
    number of steps.
    """
    scene = replace(start, **saved["shapes"])
    rng = np.random.default_rng(0)
    rng.bit_generator.state = saved["generator"]
    past = Past(tuple(saved["moments"]), saved["ages"])
    state = FitState.start(scene, backend, rng, saved["step"], saved["base"], past)
    state.grid, state.opacities_frozen, state.renewed = saved["grid"], saved["settled"], saved["renewed"]
    parameters, circular = state.parameters, saved["circular"]
    state.colored = parameters.revision if saved["colored"] else -1
    for name, held in saved["held"].items():
        parameters.hold(name, held)
    parameters.tie_circles(np.zeros(len(scene), np.int32) if circular is None else circular)
    settings = replace(settings, curves=saved["curves"])
    step = Step(state, settings, target(settings, state.step - 1), began=saved["began"])
    for renderer, (capacity, needed) in zip(step.renderers, saved["room"], strict=True):
        # What does not fit is left out until the next check, as in the fit that was saved.
        renderer.restore_capacity(Capacity(**capacity), Capacity(**needed))
    if saved["target"] is not None:
        step.loss_target.assign(saved["target"])
    step.record()
    return step


def fit_content(made: Fit) -> Content:
    """Return the result of a fit."""
    return {name: getattr(made, name) for name in FIGURES} | {"shapes": _shapes(made.scene)}


def fit_from(saved: Content, start: Scene) -> Fit:
    """Return the result of a fit that began with ``start``, from what ``fit_content`` returned."""
    figures = {name: saved[name] for name in FIGURES}
    return Fit(replace(start, **saved["shapes"]), interrupted=False, **figures)


def _shapes(scene: Scene) -> Content:
    """Return the arrays of a scene that a fit changes: not its canvas, pictures, layers' names and dashes."""
    return {name: getattr(scene, name) for name in (*LAYOUT, *(row.name for row in (*TRAITS, *ATTRIBUTES)))}
