"""Fit the outlines of a traced drawing to the image, keeping their corners, lines and smooth joints."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from warpsplat.drawing.constraints import Constraints, Drawing, Flags, Floats, with_ends
from warpsplat.drawing.crossings import Crossings
from warpsplat.drawing.measure import Measure, Samples
from warpsplat.drawing.solve import Equations, newton_step
from warpsplat.fit.problem import Run
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.metrics import decibels
from warpsplat.portable import elementary
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, FloatArray

LEAST_GAIN, MOST_IDLE = 0.005, 4
"""A refinement ends when so many steps in a row have not lowered the least error by this share."""

RAISED, CALMER, LEAST_DAMPING = 0.3, 0.1, 0.002
"""Added curvature, as a share, where a step did not lower the error, as more of it gets stuck; its factor
where one did, and its least."""

MOST_STEP = 0.7
"""How far a step may move a point along each free number [px]: measured distances hold about as far."""

ROAM_RATE, LAST_RATE, LEAST_SIZE = 0.15, 0.012, 1e-12
"""Learning rates of free numbers at the beginning and at the end of ``roam`` [px], and the least size of a
gradient."""

LOOKS = 8
"""Steps from one measurement of the contrasts to the next."""


class OutlineFit:
    """Fits the outlines of a drawing jointly, by exact coverage at full size; only their points move.

    By steps of Gauss and Newton with damping (Levenberg 1944, Marquardt 1963) that follows, for each cubic,
    whether the error around it falls.
    """

    def __init__(self, target: FloatArray, drawing: Drawing, run: Run) -> None:
        """Project the points onto the constraints.

        Args:
            target: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height,
                width, 4), of a scene on a transparent canvas.
            drawing: fills of cubics, one at least.
            run: the device.

        Raises:
            ValueError: joints do not fit the scene, or its shapes are not fills of cubics.
        """
        self._drawing, self._following = drawing, drawing.following()
        self._constraints = Constraints(drawing)
        self.points = self._constraints.project(drawing.scene.points.astype(np.float64))
        self._crossings = Crossings(drawing, self.points)
        target = matching(target, drawing.scene.canvas)
        self._measure = Measure(target, drawing, self.points, run.backend)
        self.error, self._around = self._measure.error(self.points)
        self._measure.look()

    @property
    def drawing(self) -> Drawing:
        """The drawing with the least error of those evaluated, the start among them."""
        scene = replace(self._drawing.scene, points=self.points.astype(np.float32))
        return replace(self._drawing, scene=scene)

    @property
    def least(self) -> float:
        """Curvature that does not count."""
        return self._measure.least

    def places(self) -> Samples:
        """Return where the image has the outlines."""
        self._measure.error(self.points)
        return self._measure.places(self.points)

    def hold(self, points: Floats, held: Flags) -> None:
        """Begin again at ``points``; those that are ``held``, shape (point,), stay there from now on."""
        points = self._constraints.shared(points)
        drawing = replace(self._drawing, scene=replace(self._drawing.scene, points=points.astype(np.float32)))
        self._constraints = Constraints(drawing, held)
        self.points = self._constraints.project(points)
        self._crossings = Crossings(drawing, self.points)
        self.error, self._around = self._measure.error(self.points)

    def advance(self, run: Run, steps: int, far: int = 0) -> None:
        """Make at most so many ``steps``, each with a render; fewer when ``run`` is over.

        ``far``: first steps that follow the blurred residual.
        """
        at, around, idle = self.points, self._around, 0
        damping = np.full(len(self._following), CALMER * RAISED)
        for done in range(1, steps + 1):
            gradient = self._measure.gradient(blurred=done <= far)
            if done % LOOKS == 0 and done < steps:
                self._measure.look()
            freedom = self._constraints.freedom(at)
            samples = self._measure.samples(at)
            equations = Equations(samples, with_ends(at, self._following), self._following)
            change = newton_step(equations, freedom, gradient, damping, self._measure.least)
            if done <= far:
                change = 2 * change  # blurred gradients are too small
            change = freedom.times(np.clip(change, -MOST_STEP, MOST_STEP))
            moved = self._constraints.project(at + change.reshape(-1, 2))
            at, refused = self._crossings.refuse(at, moved, self._constraints)
            error, now = self._measure.error(at)
            damping = np.where(
                (now <= around) & ~refused, np.maximum(CALMER * damping, LEAST_DAMPING), RAISED
            )
            around = now
            idle = 0 if done <= far or error < (1 - LEAST_GAIN) * self.error else idle + 1
            if error < self.error:
                self.points, self.error, self._around = at, error, now
            if run.on_progress:
                run.report(self._progress(done, steps, time.monotonic() - run.started))
            if idle >= MOST_IDLE or run.over():
                break

    def roam(self, run: Run, steps: int) -> None:
        """Make so many steps of Adam (Kingma and Ba 2015), half of them where these gain nothing.

        Where edges are less than a pixel apart, the model of single edges leads to poor minima; steps of one
        length for all, whatever their gradients, lead out of them.
        """
        start, at = (1 - MOST_IDLE * LEAST_GAIN) * self.error, self.points
        mean, square = np.zeros((2, 1))
        rate, first, second, checked = ROAM_RATE, 1.0, 1.0, self.points
        slower = float(elementary.power(LAST_RATE / ROAM_RATE, 1 / max(steps, 1)))
        for done in range(1, steps + 1):
            rate, first, second = rate * slower, 0.9 * first, 0.999 * second
            freedom = self._constraints.freedom(at)
            gradient = freedom.adjoint(self._measure.gradient())
            mean, square = 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient * gradient
            size = np.sqrt(square / (1 - second)) + LEAST_SIZE
            change = -rate * mean / (1 - first) / size
            at = self._constraints.project(at + freedom.times(change).reshape(-1, 2))
            is_checked = done % LOOKS == 0 or done == steps
            if is_checked:
                at, _ = self._crossings.refuse(checked, at, self._constraints)
                checked = at
            error, around = self._measure.error(at)
            if is_checked and error < self.error:
                self.points, self.error, self._around = at, error, around
            if run.over() or (done == steps // 2 and self.error > start):
                break
        self._measure.error(self.points)
        self._measure.look()

    def _progress(self, done: int, steps: int, seconds: float) -> Progress:
        scene = self.drawing.scene
        snapshot = Snapshot(lambda: scene, lambda: render(scene))
        figure = decibels(self.error * 255**2)
        return Progress(done, steps, figure, seconds, done / steps, True, len(scene), snapshot)


def matching(target: FloatArray, canvas: Canvas) -> FloatArray:
    """Return ``target`` with opacity, shape (height, width, 4), if the canvas is transparent."""
    if canvas.background is None and target.shape[2] == 3:
        return np.concatenate([target, np.ones_like(target[..., :1])], axis=2)
    return target
