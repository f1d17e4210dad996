"""Which shapes have gradients: those where they save more error than the bytes of further shapes would."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.fit.export import export
from warpsplat.fit.ramps import Bools, Ramps, Survey
from warpsplat.fit.rate import byte_worth
from warpsplat.fit.rounding import USUAL_GRID, finest
from warpsplat.fit.settings import Settings
from warpsplat.fit.step import Step
from warpsplat.scene import GRADIENTS, FloatArray, Paint, Scene, Spread
from warpsplat.scene.scene import IntArray, starts_of

GRADIENT_BYTES = 185
"""Of a gradient of two stops in a file, and of the link to it."""

PROMISE = 1.0
"""Gain of a new ramp over the price of its bytes from which on it is tried."""

KEEP = 4.0
"""The same once the surplus is thinned, and of gradients that are to stay: the shapes that are removed then
save about as much."""

ROUND = 1.05
"""Gain of a radial ramp over that of the linear one from which on it is preferred."""

ALIKE = 2 / 255
"""Colours of stops that differ less are one."""


def choose_paints(step: Step) -> None:
    """Give shapes gradients and take them back as the settings say, right after ``forward_complete``.

    The state's arrays are replaced; the step's buffers stay as they are.
    """
    settings, state = step.settings, step.state
    survey = Survey(step)
    least = _price(step, survey.scene) if settings.paint == "auto" else 0.0
    least *= KEEP if state.step > settings.density.thin * settings.iterations else PROMISE
    kind, ramps = _best(settings, survey, least)
    # What earlier levels show stays as it is.
    mine = np.arange(len(survey.scene)) >= state.base
    flat, bent = survey.scene.paint == Paint.FLAT, np.isin(survey.scene.paint, GRADIENTS)
    new = mine & flat & (ramps.gain > least) & ~_alike(ramps.colors)
    old = mine & bent & ((survey.flattening <= least) | _alike(_ends(survey.scene)))
    scene = without_gradients(with_ramps(survey.scene, new, kind, ramps), old, survey.flat)
    if (scene.paint != survey.scene.paint).any():
        state.parameters.repaint(scene)


def _price(step: Step, scene: Scene) -> float:
    """What a gradient has to save [mean squared error]."""
    size = len(export(scene, step.settings, min(USUAL_GRID, finest(step.settings))))
    return GRADIENT_BYTES * byte_worth(step.square_error(), size)


def _best(settings: Settings, survey: Survey, least: float) -> tuple[IntArray, Ramps]:
    """The kind and the ramp that the settings allow each shape; where the gain is less than ``least``, not
    always the best.
    """
    count = len(survey.scene)
    linear = survey.linear()
    if settings.paint == "linear":
        return np.full(count, Paint.LINEAR, np.int32), linear
    radial = survey.radial(least)
    round_ = np.ones(count, np.bool_) if settings.paint == "radial" else radial.gain > ROUND * linear.gain
    both = {
        field.name: np.where(_rows(round_, one), one, getattr(linear, field.name))
        for field in fields(Ramps)
        for one in [getattr(radial, field.name)]
    }
    return np.where(round_, Paint.RADIAL, Paint.LINEAR).astype(np.int32), Ramps(**both)


def _rows(mask: Bools, values: npt.NDArray[Any]) -> Bools:
    """``mask`` of rows in a shape that broadcasts with ``values``."""
    return mask.reshape(-1, *[1] * (values.ndim - 1))


def _alike(colors: FloatArray) -> Bools:
    """Whether two colours each, shape (shape, 2, 3), are one."""
    return np.asarray(np.abs(colors[:, 0] - colors[:, 1]).max(axis=1) < ALIKE)


def _ends(scene: Scene) -> FloatArray:
    """Colours of the first and last stop, 0 and 0 of flat shapes; shape (shape, 2, 3)."""
    ends = np.zeros((len(scene), 2, 3), np.float32)
    bent = np.flatnonzero(np.isin(scene.paint, GRADIENTS))
    ends[bent, 0] = scene.stop_colors[scene.stop_first[bent]]
    ends[bent, 1] = scene.stop_colors[scene.stop_first[bent + 1] - 1]
    return ends


def with_ramps(scene: Scene, shapes: Bools, kind: IntArray, ramps: Ramps) -> Scene:
    """The scene with gradients ``ramps`` of the kinds ``kind`` in place of the colours of ``shapes``."""
    counts = np.where(shapes, 2, np.diff(scene.stop_first))
    fresh = {
        "stop_offsets": ramps.offsets,
        "stop_colors": ramps.colors,
        "stop_opacities": np.ones_like(ramps.offsets),
    }
    stops: dict[str, Any] = {}
    for name, values in fresh.items():
        old = getattr(scene, name)
        stops[name] = np.empty((int(counts.sum()), *old.shape[1:]), np.float32)
        of_new = np.repeat(shapes, counts)
        stops[name][of_new] = values[shapes].reshape(-1, *old.shape[1:])
        stops[name][~of_new] = old[np.repeat(~shapes, np.diff(scene.stop_first))]
    return replace(
        scene,
        paint=np.where(shapes, kind, scene.paint).astype(np.int32),
        spread=np.where(shapes, Spread.PAD, scene.spread).astype(np.int32),
        focus=np.where(shapes[:, None], 0, scene.focus).astype(np.float32),
        frames=np.where(shapes[:, None], ramps.frames, scene.frames),
        # By which doubles are found.
        colors=np.where(shapes[:, None], ramps.colors.mean(axis=1), scene.colors),
        stop_first=starts_of(counts),
        **stops,
    )


def without_gradients(scene: Scene, shapes: Bools, colors: npt.NDArray[Any]) -> Scene:
    """The scene with flat ``colors``, shape (shape, 3), in place of the gradients of ``shapes``."""
    counts = np.diff(scene.stop_first)
    keep = np.repeat(~shapes, counts)
    chosen = np.where(shapes[:, None], np.clip(colors, 0, 1), scene.colors)
    return replace(
        scene,
        paint=np.where(shapes, Paint.FLAT, scene.paint).astype(np.int32),
        colors=chosen.astype(np.float32),
        stop_first=starts_of(np.where(shapes, 0, counts)),
        stop_offsets=scene.stop_offsets[keep],
        stop_colors=scene.stop_colors[keep],
        stop_opacities=scene.stop_opacities[keep],
    )
