"""Losses: terms for the image write or add to its gradient, terms for the shapes add to theirs.

A further loss is a ``Loss`` in one of the two lists at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsplat.errors import UsageError
from warpsplat.fit.custom_loss import CustomLoss, Evaluation, LossFunction, evaluate
from warpsplat.fit.settings import LOSS_WEIGHTS, LossName, Settings
from warpsplat.kernels import levels
from warpsplat.kernels.loss import alpha, edges, image, shape, window
from warpsplat.rendering.backend import Backend, Viewport, buffer
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import Renderer
from warpsplat.rendering.tiles import read_tiles, to_tiles, write_tiles
from warpsplat.scene import FloatArray


@dataclass
class LossBuffers:
    """Sums that the image losses write, by tile, channel and lane."""

    loss: wp.array = buffer(wp.float32, "tiles", 3, "lanes")
    """Squared errors, unweighted; negative until they have been computed."""
    similarity: wp.array = buffer(wp.float32, "tiles", 3, "lanes")
    """SSIM x weight."""
    edges: wp.array = buffer(wp.float32, "tiles", "planes", "lanes")
    """Squared slopes of the error x weight."""


def pixel_lanes(backend: Backend) -> int:
    """Return the threads a tile of losses of the image: one, or one a vector of pixels."""
    return 1 if backend.lanes == 1 else backend.columns


class LossTarget:
    """The image that a render is compared with, and the result of the last comparison."""

    def __init__(
        self,
        target: FloatArray,
        backend: Backend,
        viewport: Viewport,
        importance: FloatArray | None = None,
        custom: CustomLoss | None = None,
    ) -> None:
        """Copy the target (see ``Problem.target``) of the viewport's size to the device.

        ``importance``: weight of each pixel's error, shape (height, width), mean 1; default: all equal.
        ``custom``: a loss that joins or replaces the squared error.
        """
        self._backend = backend
        self.original, self.weights, self.custom = target, importance, custom
        self.squared_error = custom.squared_error if custom else 1.0
        """Weight of the squared error."""
        self.evaluation: Evaluation | None = None
        """Result of ``custom`` at the last render."""
        self._shift: FloatArray | float = 0.0
        """Difference of what a viewer shows from the render; ``assign`` has subtracted it from the target."""
        self.target: wp.array = backend.columns_of(to_tiles(target))
        self.weighted = importance is not None
        weights = np.ones(target.shape[:2], np.float32) if importance is None else importance
        self.importance: wp.array = backend.columns_of(to_tiles(weights[..., None])[:, 0])
        self.changed = False
        """Whether ``assign`` has replaced the first target."""
        sizes = {"tiles": viewport.tile_count, "planes": target.shape[2], "lanes": pixel_lanes(backend)}
        self.buffers = backend.allocate(LossBuffers, sizes)
        self.buffers.loss.fill_(-1.0)
        self.value_count = 3 * viewport.pixel_count

    def assign(self, target: FloatArray) -> None:
        """Replace the target by another one of the same shape."""
        write_tiles(self.target, to_tiles(target))
        self.buffers.loss.fill_(-1.0)
        self.changed = True
        self._shift = self.original - target

    def mean_square(self) -> float:
        """Return the unweighted mean squared error of the last step. Reads a number per tile back."""
        return self.mean(self.buffers.loss)

    def mean(self, sums: wp.array) -> float:
        """Return the mean over pixels and colours of what was summed up by lanes."""
        return float(self._backend.lane_sums(sums).sum(dtype="float64")) / self.value_count

    def evaluate(self, custom: CustomLoss, function: LossFunction, renderer: Renderer) -> None:
        """Evaluate a loss where the render is what a viewer shows, and add its gradient to the image's.

        ``function``: as ``custom.on`` gives it.
        """
        film = renderer.film.buffers
        image = np.clip(renderer.read_image() + self._shift, 0, 1).astype(np.float32)
        self.evaluation = evaluate(function, image, *([self.original] if custom.with_target else []))
        gradient = to_tiles(self.evaluation.gradient)
        if self.squared_error:
            gradient += np.float32(self.squared_error) * read_tiles(film.image_grad)
        write_tiles(film.image_grad, gradient)


@dataclass(frozen=True)
class LossInputs:
    """Inputs of the losses."""

    renderer: Renderer
    target: LossTarget
    settings: Settings
    clock: wp.array
    """Steps done, on the device, shape (1,)."""


@dataclass(frozen=True)
class Loss:
    """A term of the loss."""

    weight: Callable[[LossInputs], float]
    launch: Callable[[Program, LossInputs, float], None]
    """Records the launches for a weight."""
    value: Callable[[LossInputs], float] = lambda inputs: 0.0
    """Returns its value x weight at the last render, for image losses but the squared error."""

    def record(self, program: Program, inputs: LossInputs) -> None:
        """Record the launches, unless the weight is 0."""
        weight = self.weight(inputs)
        if weight > 0:
            self.launch(program, inputs, weight)


def _launch_image_error(program: Program, inputs: LossInputs, weight: float) -> None:
    """Write the gradient of the squared error and of 1 - SSIM in one kernel, which is bound by memory."""
    renderer, target = inputs.renderer, inputs.target
    film, viewport, backend = renderer.film, renderer.viewport, renderer.backend
    arrays = (film.buffers, target, target.buffers)
    cache, lanes = renderer.bins.buffers.tile_cache, pixel_lanes(backend)
    similarity_weight = weight_of("ssim", inputs)
    if film.planes == 4:
        if similarity_weight > 0:
            raise UsageError("loss ssim needs an image without transparency; --background gives it a colour")
        program.launch(
            alpha.make_alpha_loss(backend.column),
            (viewport.tile_count, lanes),
            *arrays,
            tile_cache=cache,
            lane_columns=backend.columns // lanes,
            split=True,
        )
        return
    program.launch(
        image.image_loss if lanes == 1 else window.window_loss,
        (viewport.tile_count, 3, lanes),
        *arrays,
        viewport,
        tile_cache=cache,
        clock=inputs.clock,
        similarity_weight=similarity_weight,
        split=True,
    )


def weight_of(name: LossName, inputs: LossInputs) -> float:
    """Return the weight of a loss that joins the squared error; 0 if it is not the one that was chosen."""
    settings = inputs.settings
    if settings.loss != name:
        return 0.0
    return LOSS_WEIGHTS[name] if settings.loss_weight is None else settings.loss_weight


def _launch_edges(program: Program, inputs: LossInputs, weight: float) -> None:
    renderer, target = inputs.renderer, inputs.target
    film, viewport, backend = renderer.film, renderer.viewport, renderer.backend
    lanes = pixel_lanes(backend)
    dim = (viewport.tile_count, film.planes, lanes)
    across, down = (backend.array(backend.column, *film.buffers.image.shape) for _ in range(2))
    values = {"across_grad": across, "down_grad": down, "lane_columns": backend.columns // lanes}
    sources = (film.buffers, target, target.buffers, viewport)
    slopes, backward = edges.make_edge_slopes(backend.column), edges.make_edge_backward(backend.column)
    program.launch(slopes, dim, *sources, values, edge_weight=weight, split=True)
    program.launch(backward, dim, *sources, values, split=True)


def _launch_custom(program: Program, inputs: LossInputs, weight: float) -> None:
    custom = inputs.target.custom
    assert custom
    function = custom.on(str(inputs.renderer.backend.device))
    program.call(inputs.target.evaluate, custom, function, inputs.renderer)


def _custom_value(inputs: LossInputs) -> float:
    evaluation = inputs.target.evaluation
    return evaluation.value if evaluation else 0.0


def _launch_by_contour(kernel: wp.Kernel) -> Callable[[Program, LossInputs, float], None]:
    """Return a function that launches ``kernel`` with one thread per contour."""

    def launch(program: Program, inputs: LossInputs, weight: float) -> None:
        parameters = inputs.renderer.parameters
        count = parameters.contour_count
        losses = parameters.backend.array(wp.float32, count)
        program.launch(kernel, count, parameters.arrays, weight=weight, contour_loss=losses)

    return launch


def _bending_weight(inputs: LossInputs) -> float:
    canvas = inputs.renderer.parameters.structure.canvas
    return inputs.settings.bending / (3 * canvas.width * canvas.height)


IMAGE_LOSSES: tuple[Loss, ...] = (
    # Mean squared error (paper eq. 12, first term) and, if that was chosen, 1 - SSIM of small windows. On a
    # transparent canvas the mean of the errors on black and on white: an image that is right on both is right
    # on any background.
    Loss(lambda inputs: 1.0, _launch_image_error),
    Loss(
        weight=lambda inputs: weight_of("ssim", inputs),
        launch=lambda program, inputs, weight: None,  # in the kernel of the squared error
        value=lambda inputs: (
            weight_of("ssim", inputs) * (1 - inputs.target.mean(inputs.target.buffers.similarity))
        ),
    ),
    # Slopes of the error: outlines that are as sharp, and run, as those of the image.
    Loss(
        weight=lambda inputs: weight_of("edges", inputs),
        launch=_launch_edges,
        value=lambda inputs: inputs.target.mean(inputs.target.buffers.edges),
    ),
    # A loss of the user's own (``fit.custom_loss``), which weighs itself.
    Loss(lambda inputs: 1.0 if inputs.target.custom else 0.0, _launch_custom, _custom_value),
)
"""The first one writes the gradient of the image, further ones add to it; the last may replace the others."""

SHAPE_LOSSES: tuple[Loss, ...] = (
    # Keeps outlines from crossing themselves (LIVE).
    Loss(lambda inputs: inputs.settings.xing, _launch_by_contour(shape.xing_backward)),
    # Straightens burrs and loops too small for the image error to remove.
    Loss(_bending_weight, _launch_by_contour(shape.bending_backward)),
)


def image_program(inputs: LossInputs) -> Program:
    """Record the image losses."""
    program = inputs.renderer.backend.program("loss")
    for loss in IMAGE_LOSSES:
        loss.record(program, inputs)
    return program


def level_programs(inputs: LossInputs, whole: Parameters) -> tuple[Program, ...]:
    """Return programs that render a level, compare, back-propagate and add the gradients to the scene's.

    ``inputs`` are those of the level, with a renderer of the first shapes; ``whole`` are all shapes.
    """
    renderer = inputs.renderer
    add = renderer.backend.program("levels")
    for name, group in renderer.parameters.groups.items():
        if group.value.shape[0] > 0:
            add.launch(
                levels.add_gradients,
                group.value.shape,
                part=group.grad,
                weight=inputs.settings.level_weight,
                grad=whole.groups[name].grad,
                split=True,
            )
    return renderer.forward_program, image_program(inputs), renderer.backward_program, add
