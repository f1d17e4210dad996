"""Fit the outlines of a traced drawing to the image, keeping their corners, lines and smooth joints."""
from __future__ import annotations
import os


import time

import numpy as np
import numpy.typing as npt
from dataclasses import replace

from warpsplat.drawing.constraints import Constraints, Drawing, Floats
from warpsplat.drawing.measure import Measure, Samples
from warpsplat.drawing.solve import Bending, newton_step
from warpsplat.fit.problem import Run
from warpsplat.rendering.renderer import Capacity
from warpsplat.scene import Canvas, FloatArray

STEPS = 12
"""Most steps of a refinement."""

LEAST_GAIN = 0.005
"""A refinement ends when a step lowers the error by less than this share."""

DAMPING, CALMER, WILDER = 0.03, 0.3, 8.0
"""Added curvature at first, as a share, and its factors after a step that lowered the error or did not."""

HS=int(os.environ.get("HS","8"))
RAISED = float(os.environ.get("RD","3"))
LEAST_DAMPING = float(os.environ.get("LD","0.01"))

MOST_STEP = float(os.environ.get("MS","0.7"))
"""How far a step may move a point along each free number [px]: measured distances hold about as far."""

MOST_FAILURES = int(os.environ.get("MF","3"))
"""Steps in a row that do not lower the error, after which a refinement ends."""


def refine_drawing(
    target: FloatArray,
    drawing: Drawing,
    run: Run,
    *,
    steps: int = STEPS,
    held: npt.NDArray[np.bool_] | None = None,
    capacity: Capacity | None = None,
) -> Drawing:
    """Fit the outlines of a drawing jointly, by exact coverage at full size; all but their points stays.

    Args:
        target: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height, width,
            4), of a scene on a transparent canvas.
        drawing: fills of cubics.
        run: how the work is carried out; when it is over, the best so far is taken.
        steps: most renders.
        held: which cubics begin at points that stay where they are, shape (cubic,).
        capacity: of the renderer to begin with, if it is known.

    Returns:
        the drawing with the least error of those evaluated, the start among them.

    Raises:
        ValueError: joints do not fit the scene, or its shapes are not fills of cubics.
    """
    if not len(drawing.scene):
        return drawing
    fit = OutlineFit(matching(target, drawing.scene.canvas), drawing, run, held, capacity)
    fit.advance(steps)
    return fit.drawing


class OutlineFit:
    """A drawing that is fitted step by step."""

    def __init__(
        self,
        target: FloatArray,
        drawing: Drawing,
        run: Run,
        held: npt.NDArray[np.bool_] | None = None,
        capacity: Capacity | None = None,
    ) -> None:
        self._run, self._drawing = run, drawing
        self._following = drawing.following()
        self._constraints = Constraints(drawing, held)
        self.measure = Measure(target, drawing, run.backend, capacity)
        self.points = self._constraints.project(drawing.scene.points.astype(np.float64))
        self.error = self.measure.error(self.points)

    @property
    def drawing(self) -> Drawing:
        """The drawing as fitted so far."""
        return replace(
            self._drawing, scene=replace(self._drawing.scene, points=self.points.astype(np.float32))
        )

    @property
    def capacity(self) -> Capacity:
        """Capacity of the renderer's arrays."""
        return self.measure.capacity

    def places(self) -> Samples:
        """Return where the image has the outlines."""
        self.measure.error(self.points)
        return self.measure.places(self.points)

    def advance(self, steps: int) -> None:
        damping = np.full(len(self._following), DAMPING)
        failures, gradient, idle = 0, None, 0
        at = self.points
        near = self.measure.surroundings(self.points)
        around = near.sums(self.measure.squares)
        for done in range(1, steps + 1):
            if gradient is None:
                gradient = self.measure.gradient()
                freedom = self._constraints.freedom(at)
                if (done-1)%HS==0:
                    self.measure.look()
                if True:
                    bending = Bending(self.measure.samples(at), self._following)
            least = self.measure.least
            change = newton_step(bending, freedom, gradient, damping, least)
            change = np.clip(change, -MOST_STEP, MOST_STEP)
            points = self._constraints.project(at + freedom.times(change).reshape(-1, 2))
            error = self.measure.error(points)
            now = near.sums(self.measure.squares)
            damping = np.where(now <= around, np.maximum(CALMER * damping, LEAST_DAMPING), np.clip(WILDER * damping, RAISED, 100.0))
            gain = 1 - error / max(self.error, 1e-12)
            if DEBUG:
                print(f"  step {done}: {self.error:.3e} -> {error:.3e} worse {(now>around).mean():.2f} damping {np.median(damping):.2g} {damping.max():.2g}")
            idle = 0 if gain >= LEAST_GAIN else idle + 1
            at, around, gradient = points, now, None
            if gain > 0:
                self.points, self.error = points, error
            if self._run.on_progress:
                self._report(done, steps)
            if idle >= MOST_FAILURES or self._run.over():
                break

    def _report(self, done: int, steps: int) -> None:
        pass


DEBUG = False


def matching(target: FloatArray, canvas: Canvas) -> FloatArray:
    """Return ``target`` with opacity, shape (height, width, 4), if the canvas is transparent."""
    if canvas.background is None and target.shape[2] == 3:
        return np.concatenate([target, np.ones_like(target[..., :1])], axis=2)
    return target
