"""The state of a fit between two steps as numbers and arrays; a resumed fit gives the same bits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from warpsplat.fit.checkpoint import Content, flag, real, whole
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.rendering.saved import parameter_arrays, parameters_from
from warpsplat.rendering.tiles import from_tiles
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.arrays import Array, between, typed

SPARE_CAPACITY = 64
"""Largest capacity over what the shapes need: more than any run keeps from times when it had more shapes."""

FINEST = 1e7
"""Most view box units per pixel."""

MOST_RENEWED = 1 << 40
"""Largest count of shapes that were reset."""

TARGETS = 10.0
"""Largest value of the target: the image, less the viewer's difference from the render."""


def step_content(step: Step) -> Content:
    """Return everything that ``step`` carries to the next one, copied to the host."""
    state = step.state
    numbers = {
        "step": state.step,
        "began": step.began,
        "curves": step.settings.curves,
        "per_pixel": state.per_pixel,
        "settled": state.opacities_frozen,
        "rounding": state.rounding,
        "renewed": state.recovered,
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

    Raises:
        ValueError, TypeError, KeyError, OverflowError: it is not the state of such a fit.
    """
    numbers = content.numbers
    done = whole(numbers, "step", begin + 1, settings.iterations - 1)
    settings = replace(settings, curves=whole(numbers, "curves", 1, settings.curves))
    parameters = parameters_from(content.arrays, start, backend)
    if base > parameters.shape_count:
        raise ValueError("shapes of earlier levels are missing")
    clock = backend.array(wp.int32, 1)
    clock.fill_(done)
    state = FitState(
        parameters,
        clock,
        _generator(numbers["generator"]),
        done,
        real(numbers, "per_pixel", 1e-3, FINEST),
        base=base,
        opacities_frozen=flag(numbers, "settled"),
        rounding=flag(numbers, "rounding"),
        recovered=whole(numbers, "renewed", 0, MOST_RENEWED),
        colored=parameters.revision if flag(numbers, "colored") else -1,
    )
    step = Step(state, settings, target(settings, done - 1), began=whole(numbers, "began", 0, done))
    capacities = numbers["room"]
    if not isinstance(capacities, list) or len(capacities) != len(step.renderers):
        raise ValueError("room does not match the renderers")
    for renderer, capacity in zip(step.renderers, capacities, strict=True):
        _restore_capacity(renderer, capacity)
    if "target" in content.arrays:
        step.loss_target.assign(_target(content.arrays, step.target.image))
    step.record()
    return step


def _capacity(renderer: Renderer) -> dict[str, int]:
    capacity, needed = renderer.capacity_and_need()
    return {
        "samples": capacity.samples,
        "slots": capacity.slots,
        "needed samples": needed.samples,
        "needed slots": needed.slots,
    }


def _restore_capacity(renderer: Renderer, saved: Any) -> None:
    """Set the capacity: what does not fit is left out until the next check, as in the fit that was saved."""
    if not isinstance(saved, dict):
        raise TypeError("room is not a table")
    now, _ = renderer.capacity_and_need()
    samples, slots = SPARE_CAPACITY * now.samples, SPARE_CAPACITY * now.slots
    renderer.restore_capacity(
        Capacity(whole(saved, "samples", 1, samples), whole(saved, "slots", 1, slots)),
        Capacity(whole(saved, "needed samples", 0, samples), whole(saved, "needed slots", 0, slots)),
    )


def _generator(state: Any) -> np.random.Generator:
    generator = np.random.default_rng(0)
    generator.bit_generator.state = state
    return generator


def _target(arrays: dict[str, Array], image: FloatArray) -> FloatArray:
    found = typed(arrays, "target", np.float32)
    if found.shape != image.shape:
        raise ValueError(f"target has shape {found.shape}, not {image.shape}")
    between("target", found, -TARGETS, TARGETS)
    return found
