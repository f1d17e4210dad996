"""The loss by which shapes are judged between steps: its value, where it is large, what a change costs.

The squared error is quadratic in the image, so that what it costs to remove a shape, to recolour it or to
paint it with a gradient follows from the target and the pixels' weights. Any other loss is replaced by the
squared error against another target and with other weights that has its gradient at the render, and its
curvature along a change of the kind that matters: the removal of some shapes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from warpsplat.alpha import squares
from warpsplat.fit.export import shown_image
from warpsplat.fit.losses import IMAGE_LOSSES, LossInputs, LossTarget, image_program
from warpsplat.fit.problem import Problem
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import Renderer
from warpsplat.rendering.tiles import from_tiles, read_tiles, to_tiles, write_tiles
from warpsplat.scene import FloatArray, Scene


@dataclass(frozen=True)
class Quadratic:
    """A loss near the last render: a weighted squared error."""

    renderer: Renderer
    target: wp.array
    """By tiles, as the film's image."""
    weights: wp.array
    """Weights of the pixels, 0 outside the image, by tiles, as the film's ``inside``."""

    def pixel_weights(self) -> FloatArray:
        """Return the weights of the pixels, shape (tile, TILE, TILE)."""
        return read_tiles(self.weights)

    def removal_costs(self) -> FloatArray:
        """Return by how much the loss grows without each shape, shape (shape,)."""
        return self.renderer.removal_costs(self.target, self.weights)

    def residual(self) -> FloatArray:
        """Return target - render, by colour, shape (tile, 3, TILE, TILE).

        On a transparent canvas, the mean of the residuals on black and on white.
        """
        residual = read_tiles(self.target) - read_tiles(self.renderer.film.buffers.image)
        if residual.shape[1] == 4:
            residual = residual[:, :3] - 0.5 * residual[:, 3:]
        return np.asarray(residual, np.float32)


class Objective:
    """The loss of the last render. Reads images back: for use between steps."""

    def __init__(self, inputs: LossInputs, program: Program) -> None:
        """``program`` evaluates the losses of images with these ``inputs``."""
        self._inputs, self._program = inputs, program
        self._renderer, self._target = inputs.renderer, inputs.target
        self._further = [loss for loss in IMAGE_LOSSES[1:] if loss.weight(inputs) > 0]
        """Image losses that join or replace the squared error."""

    def square_error(self, weights: FloatArray | None = None) -> float:
        """Return the mean squared error, with ``weights`` by tiles."""
        film = self._renderer.film.buffers
        difference = read_tiles(film.image) - read_tiles(self._target.target)
        errors = squares(difference, axis=1) * (read_tiles(film.inside) if weights is None else weights)
        return float(errors.sum(dtype="float64")) / self._target.value_count

    def value(self) -> float:
        """Return the loss: the squared error, or with the pixels' weights what joins or replaces it."""
        if not self._further:
            return self.square_error()
        self._program.run()
        joining = sum(loss.value(self._inputs) for loss in self._further)
        weight = self._target.squared_error
        return joining + (weight * self.square_error(self._weights()) if weight else 0.0)

    def value_of(self, image: FloatArray) -> float:
        """Return the loss of another image, in the render's shape, which takes the render's place."""
        write_tiles(self._renderer.film.buffers.image, to_tiles(image))
        return self.value()

    def by_pixel(self) -> FloatArray:
        """Return where the loss is large, shape (height, width), of any scale: its values by pixel if it has
        some, else its gradient's squares, of which those of the squared error are the squared error.
        """
        image, target, viewport = self._renderer.read_image(), self._target, self._renderer.viewport
        errors = squares(image - target.original)
        weighted = errors if target.weights is None else target.weights * errors
        if not self._further:
            return weighted
        self._program.run()
        evaluation = target.evaluation
        if evaluation is not None and evaluation.by_pixel is not None:
            values = evaluation.by_pixel - min(float(evaluation.by_pixel.min()), 0.0)  # none is negative
            return np.asarray(target.squared_error / 3 * weighted + values)
        tiles = squares(self._errors(1.0), axis=1) * self._weights()
        return from_tiles(tiles[:, None], viewport.width, viewport.height)[..., 0]

    def quadratic(self) -> Quadratic:
        """Return the loss near the render. Unless it is the squared error, renders twice."""
        target, columns_of = self._target, self._renderer.backend.columns_of
        if not self._further:
            return Quadratic(self._renderer, target.target, target.importance)
        curvature = self._curvature()
        self._program.run()
        aim = read_tiles(self._renderer.film.buffers.image) - self._errors(curvature)
        return Quadratic(self._renderer, columns_of(aim), columns_of(curvature * self._weights()))

    def _weights(self) -> FloatArray:
        return read_tiles(self._target.importance)

    def _errors(self, curvature: float) -> FloatArray:
        """Return render - target of the weighted squared error with the gradient that was written last, shape
        (tile, plane, TILE, TILE); its weights are ``curvature`` times those of the pixels.
        """
        weights = (curvature * self._weights())[:, None]
        slopes = read_tiles(self._renderer.film.buffers.image_grad) * self._target.value_count
        slopes = np.divide(slopes, weights, out=np.zeros_like(slopes), where=weights > 0)
        errors = 0.5 * slopes[:, :3]
        if slopes.shape[1] == 4:  # the errors e on black, a of the opacity: slopes are 2 e - a, 3 a - sum(e)
            opacity = (slopes[:, 3:] + errors.sum(axis=1, keepdims=True)) / 1.5
            errors = np.concatenate([errors + 0.5 * opacity, opacity], axis=1)
        return np.asarray(errors, np.float32)

    def _curvature(self) -> float:
        """Return the curvature along the removal of some shapes, over that of the squared error."""
        renderer, film = self._renderer, self._renderer.film.buffers
        scene = renderer.parameters.scene()
        before, image = self.value(), read_tiles(film.image).copy()
        slopes = read_tiles(film.image_grad).copy()
        fewer = scene.opacities.copy()
        probed = 8  # every one of so many shapes is removed to measure a loss's curvature
        fewer[::probed] = 0
        renderer.parameters.assign(replace(scene, opacities=fewer))
        renderer.forward()
        change = read_tiles(film.image) - image
        linear, size = (
            float((slopes * change).sum(dtype="float64")),
            squares(change, axis=1) * self._weights(),
        )
        bend = self.value() - before - linear
        renderer.parameters.assign(scene)
        renderer.forward()
        length = float(size.sum(dtype="float64")) / self._target.value_count
        # Least part that the curvature has in what that costs, over the gradient's: some losses bend down.
        least_bend = 0.1
        return max(bend, least_bend * abs(linear)) / length if length > 0 and linear else 1.0


def loss_of_file(text: str, scene: Scene, problem: Problem, backend: Backend) -> float:
    """Return the loss of a scene's file as a viewer shows it."""
    viewport = Viewport(*problem.size, 1.0)
    target = LossTarget(problem.target, backend, viewport, custom=problem.loss)
    renderer = Renderer(Parameters(scene, backend), viewport)
    inputs = LossInputs(renderer, target, problem.settings, backend.array(wp.int32, 1))
    objective = Objective(inputs, image_program(inputs))
    return objective.value_of(shown_image(text, scene, problem.target.shape[2]))
