"""A fit between two steps, or its result, as numbers and arrays; a resumed fit gives the same bits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import warp as wp

from warpsplat.fit.checkpoint import Content, number
from warpsplat.fit.problem import Fit
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.rendering.saved import parameter_arrays, parameters_from
from warpsplat.rendering.tiles import from_tiles
from warpsplat.scene import Scene
from warpsplat.scene.arrays import between, from_arrays, to_arrays, typed

SPARE_CAPACITY = 64
"""Largest capacity over what the shapes need: more than any run keeps from times when it had more shapes."""

FINEST = 1e7
"""Most view box units per pixel."""

MOST_RENEWED = 1 << 40
"""Largest count of shapes that were reset."""

TARGETS = 10.0
"""Largest value of the target: the image, less the viewer's difference from the render."""

SAVED = {"per_pixel": float, "render_psnr": float, "estimated_psnr": float, "iterations": int, "renewed": int}
"""Fields of a ``Fit`` that are saved beside its scene."""

SAVED_LIMIT = 1e9
"""Largest of them."""


def step_content(step: Step) -> Content:
    """Return everything that ``step`` carries to the next one, copied to the host."""
    state = step.state
    numbers = {
        "step": state.step,
        "began": step.began,
        "curves": step.settings.curves,
        "per_pixel": float(state.per_pixel),
        "settled": state.opacities_frozen,
        "rounding": state.grid is not None,
        "renewed": state.renewed,
        "colored": state.colored == state.parameters.revision,
        "generator": state.rng.bit_generator.state,
        "room": [_capacity(renderer) for renderer in step.renderers],
    }
    arrays = parameter_arrays(state.parameters)
    if step.loss_target.changed:
        viewport = step.target.viewport
        arrays["target"] = from_tiles(step.loss_target.target.numpy(), viewport.width, viewport.height)
    return Content(numbers, arrays)


def step_from(
    content: Content,
    start: Scene,
    settings: Settings,
    backend: Backend,
    base: int,
    begin: int,
    target: Callable[[Settings, int], Target],
) -> Step:
    """Return the step that ``step_content`` saved as ``content``.

    The fit began with the scene ``start`` and ``settings`` at the step ``begin``; ``base`` is the number of
    shapes of earlier levels, and ``target`` returns the target of the step after a number of steps.

    Raises one of the errors of ``Checkpoint.reading`` if it is not the state of such a fit.
    """
    numbers = content.numbers
    done = number(numbers, "step", int, begin + 1, settings.iterations - 1)
    settings = replace(settings, curves=number(numbers, "curves", int, 1, settings.curves))
    parameters = parameters_from(content.arrays, start, backend)
    if base > parameters.shape_count:
        raise ValueError("shapes of earlier levels are missing")
    rng = np.random.default_rng(0)
    rng.bit_generator.state = numbers["generator"]
    clock = backend.array(wp.int32, 1)
    clock.fill_(done)
    grid = number(numbers, "per_pixel", float, 1e-3, FINEST)
    state = FitState(
        parameters,
        clock,
        rng,
        done,
        base,
        opacities_frozen=number(numbers, "settled", bool),
        grid=grid if number(numbers, "rounding", bool) else None,
        renewed=number(numbers, "renewed", int, 0, MOST_RENEWED),
        colored=parameters.revision if number(numbers, "colored", bool) else -1,
    )
    step = Step(state, settings, target(settings, done - 1), began=number(numbers, "began", int, 0, done))
    for renderer, capacity in zip(step.renderers, numbers["room"], strict=True):
        _restore_capacity(renderer, capacity)
    if "target" in content.arrays:
        shifted = typed(content.arrays, "target", np.float32)
        if shifted.shape != step.target.image.shape:
            raise ValueError(f"target has shape {shifted.shape}, not {step.target.image.shape}")
        between("target", shifted, -TARGETS, TARGETS)
        step.loss_target.assign(shifted)
    step.record()
    return step


def fit_content(made: Fit) -> Content:
    """Return the result of a fit."""
    return Content({name: kind(getattr(made, name)) for name, kind in SAVED.items()}, to_arrays(made.scene))


def fit_from(content: Content, start: Scene) -> Fit:
    """Return the result of a fit that began with ``start``, from what ``fit_content`` returned."""
    numbers, most = content.numbers, SAVED_LIMIT
    figures = {name: number(numbers, name, kind, -most, most) for name, kind in SAVED.items()}
    return Fit(from_arrays(content.arrays, start), interrupted=False, **figures)


def _capacity(renderer: Renderer) -> dict[str, int]:
    capacity, needed = map(asdict, renderer.capacity_and_need())
    return capacity | {f"needed {name}": size for name, size in needed.items()}


def _restore_capacity(renderer: Renderer, saved: Any) -> None:
    """Set the capacity: what does not fit is left out until the next check, as in the fit that was saved."""
    if not isinstance(saved, dict):
        raise TypeError("room is no table")
    most = {name: SPARE_CAPACITY * size for name, size in asdict(renderer.capacity).items()}
    capacity, needed = (
        Capacity(**{name: number(saved, prefix + name, int, least, size) for name, size in most.items()})
        for least, prefix in ((1, ""), (0, "needed "))
    )
    renderer.restore_capacity(capacity, needed)
