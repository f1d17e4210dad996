"""Fit the outlines of a traced drawing to the image, keeping their corners, lines and smooth joints."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from warpsplat.fit.constraints import Constraints, Drawing, Projection
from warpsplat.fit.densification import recover
from warpsplat.fit.problem import Run
from warpsplat.fit.progress import Progress
from warpsplat.fit.schedule import CHECK_INTERVAL, Phase
from warpsplat.fit.settings import Density, Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity
from warpsplat.scene import Canvas, FloatArray, Scene

Colors = Literal["held", "fitted"]

OUTLINE_STEPS = 200
"""Most steps of a refinement."""

OUTLINE_RATE = 0.08
"""Learning rate of points at the start [px]: larger ones entangle the outlines of small letters."""

FINAL_RATE = 0.02
"""Learning rates at the end over those at the start: what is left to gain is hundredths of a pixel."""

COLOR_RATE = 0.004
"""Learning rate of colours: one of 256 levels."""

LEAST_GAIN, GAIN_STEPS = 0.005, 40
"""A refinement ends when the error has not fallen by this share in so many steps."""


SNAP_DISTANCE = 6 / 255
"""Largest difference in each channel between a fitted colour and the image's colour that it is snapped to."""

SNAP_SHARE = 0.5
"""Least share of that colour among the image's colours nearby: in a noisy image no colour has it."""


@dataclass(frozen=True)
class Refinement:
    """Options of a refinement."""

    steps: int = OUTLINE_STEPS
    point_rate: float = OUTLINE_RATE
    """[px] at the start."""
    colors: Colors = "held"
    """Whether colours stay, or are fitted and then snapped to those of the image."""

    def settings(self, scene: Scene) -> Settings:
        """Return the settings: the shapes stay, and the loss is the squared error alone."""
        plain = make_settings(
            curves=max(1, min(len(scene), 100_000)),
            iterations=self.steps,
            texture=0.0,
            bending=0.0,
            final_rate=FINAL_RATE,
            rates={"points": self.point_rate, "colors": COLOR_RATE},
        )
        return replace(plain, coarse=0.0, density=Density(interval=0))


def refine_drawing(
    target: FloatArray,
    drawing: Drawing,
    run: Run,
    how: Refinement | None = None,
    *,
    held: npt.NDArray[np.bool_] | None = None,
    capacity: Capacity | None = None,
) -> Drawing:
    """Fit the outlines of a drawing jointly, by exact coverage at full size; shapes and their opacities stay.

    Args:
        target: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height, width,
            4), of a scene on a transparent canvas.
        drawing: fills of cubics.
        run: how the work is carried out; when it is over, the best so far is taken.
        how: rates and steps.
        held: points that stay where they are, shape (point,).
        capacity: of the renderer to begin with, if it is known.

    Returns:
        the drawing with the least error of those evaluated, the start among them.

    Raises:
        ValueError: joints do not fit the scene, or its shapes are not fills of cubics.
    """
    how = how or Refinement()
    if not len(drawing.scene):
        return drawing
    target = matching(target, drawing.scene.canvas)
    step = start(target, drawing, run.backend, how, held, capacity)
    best, least = _evaluate(step)
    gained = 0
    """Steps at the last gain that counts."""
    for done in range(1, how.steps + 1):
        step.advance()
        if done % CHECK_INTERVAL == 0 or done == how.steps:
            recover(step, replaces=False)
            found, error = _evaluate(step)
            if error < (1 - LEAST_GAIN) * least:
                gained = done
            if error < least:
                best, least = found, error
            if run.on_progress:
                run.report(_progress(step, done, how.steps, time.monotonic() - run.started))
        if done - gained >= GAIN_STEPS or run.over():
            break
    if how.colors == "fitted":
        snapped = replace(best, colors=own_colors(best, target))
        step.state.parameters.assign(snapped)
        best = _evaluate(step)[0]
    return replace(drawing, scene=best)


def _progress(step: Step, done: int, steps: int, seconds: float) -> Progress:
    shapes, snapshot = step.state.shape_count, step.snapshot()
    return Progress(done, steps, step.psnr(), seconds, done / steps, True, shapes, snapshot)


def matching(target: FloatArray, canvas: Canvas) -> FloatArray:
    """Return ``target`` with opacity, shape (height, width, 4), if the canvas is transparent."""
    if canvas.background is None and target.shape[2] == 3:
        return np.concatenate([target, np.ones_like(target[..., :1])], axis=2)
    return target


def start(
    target: FloatArray,
    drawing: Drawing,
    backend: Backend,
    how: Refinement,
    held: npt.NDArray[np.bool_] | None = None,
    capacity: Capacity | None = None,
) -> Step:
    """Return a step for ``drawing``, its points projected onto the constraints; ``held`` ones stay there.

    ``capacity``: of the renderer to begin with; the first evaluation enlarges it if need be.
    """
    state = FitState.start(drawing.scene, backend, np.random.default_rng(0))
    projection = Projection(Constraints.of(drawing), state.parameters, held)
    projection.project()
    state.projection = projection
    every = np.ones(len(drawing.scene), np.bool_)
    state.parameters.hold("opacities", every)
    state.parameters.hold("stop_opacities", np.ones(len(drawing.scene.stop_opacities), np.bool_))
    if how.colors == "held":
        state.parameters.hold("colors", every)
        state.parameters.keeps_colors = True
    height, width = target.shape[:2]
    goal = Target(target, Phase(width, height, slack=1.0))
    return Step(state, how.settings(drawing.scene), goal, capacity=capacity)


def _evaluate(step: Step) -> tuple[Scene, float]:
    """Return the scene and its mean squared error."""
    step.render()
    return step.state.scene(), step.measured_error()


def own_colors(scene: Scene, target: FloatArray) -> FloatArray:
    """Return the colours of the shapes, snapped to the image's 8-bit colours, shape (shape, 3).

    A colour is snapped to the most frequent one near it, unless many others lie near as well: then the fitted
    mean is better.
    """
    pixels = target.reshape(-1, target.shape[2])
    if target.shape[2] == 4:
        pixels = pixels[pixels[:, 3] > 1 - 0.5 / 255][:, :3]
    levels, counts = np.unique(np.round(pixels * 255).astype(np.uint8), axis=0, return_counts=True)
    palette = levels.astype(np.float32) / np.float32(255)
    colors = scene.colors.copy()
    for i, color in enumerate(scene.colors):
        near = np.flatnonzero((np.abs(palette - color) <= SNAP_DISTANCE).all(axis=1))
        if len(near):
            most = near[counts[near].argmax()]
            if counts[most] >= SNAP_SHARE * counts[near].sum():
                colors[i] = palette[most]
                continue
        colors[i] = np.round(color * 255) / 255
    return colors
