"""Outlines of a drawing fitted to the picture, clean as they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from warpsplat.fit.constraints import Constraints, Drawing, Ints, Projection
from warpsplat.fit.recover import recover
from warpsplat.fit.schedule import CHECK_INTERVAL, Phase
from warpsplat.fit.settings import Density, Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.fit.work import Progress
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity
from warpsplat.scene import Canvas, FloatArray, Scene

Colors = Literal["held", "fitted"]

STEPS = 200
"""Of a refinement."""

POINT_RATE = 0.25
"""Learning rate of points at the start [px]: outlines are traced to about a pixel."""

FINAL_RATE = 0.02
"""Fraction of the rates at the end: what is left to gain is hundredths of a pixel."""

COLOR_RATE = 0.004
"""Learning rate of colours: a level."""


GAIN, PATIENCE = 0.005, 40
"""Where the error has not fallen by this share in so many steps, the rest is not worth its time."""


@dataclass(frozen=True)
class Refinement:
    """How to fit a drawing."""

    steps: int = STEPS
    point_rate: float = POINT_RATE
    """[px] at the start."""
    colors: Colors = "held"
    """Whether colours stay or are fitted and then snapped to those of the picture."""

    def settings(self, scene: Scene) -> Settings:
        """As a run has them: nothing comes, goes or is weighed but the squared error."""
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
    scene: Scene,
    joints: Ints,
    same: Ints,
    backend: Backend,
    how: Refinement | None = None,
    *,
    held: npt.NDArray[np.bool_] | None = None,
    capacity: Capacity | None = None,
    report: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Scene:
    """Fit the outlines of a drawing jointly, by exact coverage at full size; shapes and their opacities
    stay.

    Args:
        target: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height, width,
            4), of a scene on a transparent canvas.
        scene: fills of cubics.
        joints: ``Joint`` of each point, shape (point,).
        same: see ``Drawing``, shape (point,).
        backend: where to compute.
        how: rates and steps.
        held: points that stay where they are, shape (point,).
        capacity: of the renderer to begin with, if it is known.
        report: called every few steps.
        stop: asked after every step; once true, the best so far is taken.

    Returns:
        the scene with the least error of those looked at, its start among them.

    Raises:
        ValueError: ``joints`` or ``same`` do not fit the scene, or its shapes are no fills of cubics.
    """
    how = how or Refinement()
    drawing = Drawing(scene, joints, same)
    if not len(scene):
        return scene
    target = matching(target, scene.canvas)
    step = start(target, drawing, backend, how, held, capacity)
    best, least = _look(step)
    gained = 0
    """Steps at the last gain that counts."""
    for done in range(1, how.steps + 1):
        step.advance()
        if done % CHECK_INTERVAL == 0 or done == how.steps:
            recover(step, replaces=False)
            found, error = _look(step)
            if error < (1 - GAIN) * least:
                gained = done
            if error < least:
                best, least = found, error
            if report:
                work, shapes = done / how.steps, step.state.shape_count
                report(Progress(done, how.steps, step.psnr(), 0.0, work, True, shapes, step.snapshot()))
        if done - gained >= PATIENCE or (stop and stop()):
            break
    if how.colors == "fitted":
        snapped = replace(best, colors=own_colors(best, target))
        step.state.parameters.assign(snapped)
        best = _look(step)[0]
    return best


def matching(target: FloatArray, canvas: Canvas) -> FloatArray:
    """``target`` with opacity, shape (height, width, 4), where the canvas is transparent."""
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
    """A step for ``drawing``, whose points are brought to where they may be; ``held`` ones stay there.
    ``capacity``: to begin with; the first look makes room where it is not enough.
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


def _look(step: Step) -> tuple[Scene, float]:
    """The scene and its mean squared error."""
    step.render()
    return step.state.scene(), step.measured_error()


NEAR = 6 / 255
"""A colour of the picture is a shape's own where it lies within so much of it in each channel."""

OFTEN = 0.5
"""... and where so much of what lies near it is of just that colour: in a noisy picture none is."""


def own_colors(scene: Scene, target: FloatArray) -> FloatArray:
    """Colours of the shapes, snapped to one of the picture's 8-bit ones where that is plainly meant.

    The most frequent colour near a shape's is meant, unless many others lie near as well: then the mean that
    was fitted is better. Shape (shape, 3).
    """
    pixels = target.reshape(-1, target.shape[2])
    if target.shape[2] == 4:
        pixels = pixels[pixels[:, 3] > 1 - 0.5 / 255][:, :3]
    levels, counts = np.unique(np.round(pixels * 255).astype(np.uint8), axis=0, return_counts=True)
    palette = levels.astype(np.float32) / np.float32(255)
    colors = scene.colors.copy()
    for i, color in enumerate(scene.colors):
        near = np.flatnonzero((np.abs(palette - color) <= NEAR).all(axis=1))
        if len(near):
            most = near[counts[near].argmax()]
            if counts[most] >= OFTEN * counts[near].sum():
                colors[i] = palette[most]
                continue
        colors[i] = np.round(color * 255) / 255
    return colors
