"""Repainting: shapes get gradients where these save more error than their bytes are worth, or lose them."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from warpsplat.fit.export import export
from warpsplat.fit.ramps import Bools, Ramps, RampSolver
from warpsplat.fit.rounding import USUAL_GRID, byte_worth, finest
from warpsplat.fit.settings import Settings
from warpsplat.scene import GRADIENTS, FloatArray, Paint, Scene, Spread
from warpsplat.scene.scene import IntArray, starts_of
from warpsplat.svg.sizes import GRADIENT

if TYPE_CHECKING:
    from warpsplat.fit.step import Step

GAIN_TO_TRY, GAIN_TO_KEEP = 1.0, 4.0
"""Minimum gain of a ramp over the worth of its bytes: while shapes are still added, and while the surplus is
removed, when the shapes removed save about as much."""

SAME_COLOR = 2 / 255
"""Difference in each channel below which the colours of two stops are one."""


def choose_paints(step: Step) -> None:
    """Give shapes gradients, or flat colours again, by the settings; call right after ``forward_complete``.

    The state's arrays are replaced; the step's buffers stay as they are.
    """
    settings, state = step.settings, step.state
    solver = RampSolver(step)
    scene = solver.scene
    min_gain = 0.0
    if settings.painting == "auto":
        size = len(export(scene, settings, min(USUAL_GRID, finest(settings))))
        min_gain = GRADIENT * byte_worth(step.objective.value(), size)
    surplus = state.step > settings.density.thin * settings.iterations
    min_gain *= GAIN_TO_KEEP if surplus else GAIN_TO_TRY
    kind, ramps = _best_ramps(settings, solver, min_gain)
    trained = np.arange(len(scene)) >= state.base  # shapes of earlier levels stay as they are
    flat, gradient = scene.paint == Paint.FLAT, np.isin(scene.paint, GRADIENTS)
    gained = trained & flat & (ramps.gain > min_gain) & ~_are_same(ramps.colors)
    lost = trained & gradient & ((solver.flattening <= min_gain) | _are_same(_end_colors(scene)))
    repainted = without_gradients(with_ramps(scene, gained, kind, ramps), lost, solver.flat)
    if (repainted.paint != scene.paint).any():
        state.parameters.repaint(repainted)


def _best_ramps(settings: Settings, solver: RampSolver, min_gain: float) -> tuple[IntArray, Ramps]:
    """Return the kind and the best ramp of each shape; where the gain is below ``min_gain``, any."""
    count = len(solver.scene)
    linear = solver.linear()
    if settings.painting == "linear":
        return np.full(count, Paint.LINEAR, np.int32), linear
    radial = solver.radial(min_gain)
    if settings.painting == "radial":
        return np.full(count, Paint.RADIAL, np.int32), radial
    radial_advantage = 1.05  # gain of a radial ramp over that of the linear one above which it is preferred
    chosen = radial.gain > radial_advantage * linear.gain
    both = [(getattr(radial, f.name), getattr(linear, f.name)) for f in fields(Ramps)]
    ramps = Ramps(*(np.where(chosen.reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in both))
    return np.where(chosen, Paint.RADIAL, Paint.LINEAR).astype(np.int32), ramps


def _are_same(colors: FloatArray) -> Bools:
    """Return which pairs of colours, shape (shape, 2, 3), are the same for a viewer."""
    return np.asarray(np.abs(colors[:, 0] - colors[:, 1]).max(axis=1) < SAME_COLOR)


def _end_colors(scene: Scene) -> FloatArray:
    """Return the colours of each gradient's first and last stop, 0 for flat shapes; shape (shape, 2, 3)."""
    ends = np.zeros((len(scene), 2, 3), np.float32)
    shapes = np.flatnonzero(np.isin(scene.paint, GRADIENTS))
    ends[shapes, 0] = scene.stop_colors[scene.stop_first[shapes]]
    ends[shapes, 1] = scene.stop_colors[scene.stop_first[shapes + 1] - 1]
    return ends


def with_ramps(scene: Scene, shapes: Bools, kind: IntArray, ramps: Ramps) -> Scene:
    """Return the scene with gradients ``ramps`` of kinds ``kind`` in place of the colours of ``shapes``."""
    counts = np.where(shapes, 2, np.diff(scene.stop_first))
    is_new = np.repeat(shapes, counts)
    added = {
        "stop_offsets": ramps.offsets,
        "stop_colors": ramps.colors,
        "stop_opacities": np.ones_like(ramps.offsets),
    }
    stops: dict[str, Any] = {}
    for name, values in added.items():
        old = getattr(scene, name)
        stops[name] = np.empty((len(is_new), *old.shape[1:]), np.float32)
        stops[name][is_new] = values[shapes].reshape(-1, *old.shape[1:])
        stops[name][~is_new] = old[np.repeat(~shapes, np.diff(scene.stop_first))]
    return replace(
        scene,
        paint=np.where(shapes, kind, scene.paint).astype(np.int32),
        spread=np.where(shapes, Spread.PAD, scene.spread).astype(np.int32),
        focus=np.where(shapes[:, None], 0, scene.focus).astype(np.float32),
        frames=np.where(shapes[:, None], ramps.frames, scene.frames),
        # By which duplicates are found.
        colors=np.where(shapes[:, None], ramps.colors.mean(axis=1), scene.colors),
        stop_first=starts_of(counts),
        **stops,
    )


def without_gradients(scene: Scene, shapes: Bools, colors: npt.NDArray[Any]) -> Scene:
    """Return the scene with flat ``colors``, shape (shape, 3), in place of the gradients of ``shapes``."""
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
