"""Losses: terms for the image write or add to its gradient, terms for the shapes add to theirs.

A further loss is a ``Loss`` in one of the two lists at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsplat.fit.settings import Settings
from warpsplat.kernels import levels
from warpsplat.kernels.loss import alpha, image, shape, window
from warpsplat.rendering.backend import Backend, Viewport, buffer
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import Renderer
from warpsplat.rendering.tiles import to_tiles, write_tiles
from warpsplat.scene import Canvas, FloatArray


@dataclass
class LossBuffers:
    """Sums that the image losses write, by tile, channel and lane."""

    loss: wp.array = buffer(wp.float32, "tiles", 3, "lanes")
    """Squared errors, unweighted; negative until they have been computed."""
    similarity: wp.array = buffer(wp.float32, "tiles", 3, "lanes")
    """SSIM x weight."""


def pixel_lanes(backend: Backend) -> int:
    """Return the threads a tile of losses of the image: one, or one a vector of pixels."""
    return 1 if backend.lanes == 1 else backend.columns


class LossTarget:
    """The image that a render is compared with, and the result of the last comparison."""

    def __init__(
        self, target: FloatArray, backend: Backend, viewport: Viewport, importance: FloatArray | None = None
    ) -> None:
        """Copy the target (see ``Problem.target``) of the viewport's size to the device.

        ``importance``: weight of each pixel's error, shape (height, width), mean 1; default: all equal.
        """
        self._backend = backend
        self.target: wp.array = backend.columns_of(to_tiles(target))
        self.weighted = importance is not None
        weights = np.ones(target.shape[:2], np.float32) if importance is None else importance
        self.importance: wp.array = backend.columns_of(to_tiles(weights[..., None])[:, 0])
        self.changed = False
        """Whether ``assign`` has replaced the first target."""
        sizes = {"tiles": viewport.tile_count, "lanes": pixel_lanes(backend)}
        self.buffers = backend.allocate(LossBuffers, sizes)
        self.buffers.loss.fill_(-1.0)
        self.value_count = 3 * viewport.pixel_count

    def assign(self, target: FloatArray) -> None:
        """Replace the target by another one of the same shape."""
        write_tiles(self.target, to_tiles(target))
        self.buffers.loss.fill_(-1.0)
        self.changed = True

    def mean_square(self) -> float:
        """Return the unweighted mean squared error of the last step. Reads a number per tile back."""
        return float(self._backend.lane_sums(self.buffers.loss).sum(dtype="float64")) / self.value_count


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

    weight: Callable[[Settings, Canvas], float]
    launch: Callable[[Program, LossInputs, float], None]
    """Records the launches for a weight."""
    reason: str

    def record(self, program: Program, inputs: LossInputs) -> None:
        """Record the launches, unless the weight is 0."""
        weight = self.weight(inputs.settings, inputs.renderer.parameters.canvas)
        if weight > 0:
            self.launch(program, inputs, weight)


def _launch_image_error(program: Program, inputs: LossInputs, weight: float) -> None:
    """Write the gradient of the squared error and of 1 - SSIM in one kernel, which is bound by memory."""
    renderer, target = inputs.renderer, inputs.target
    film, viewport, backend = renderer.film, renderer.viewport, renderer.backend
    arrays = (film.buffers, target, target.buffers)
    cache, lanes = renderer.bins.buffers.tile_cache, pixel_lanes(backend)
    if film.planes == 4:
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
        similarity_weight=inputs.settings.ssim,
        split=True,
    )


def _launch_by_contour(kernel: wp.Kernel) -> Callable[[Program, LossInputs, float], None]:
    """Return a function that launches ``kernel`` with one thread per contour."""

    def launch(program: Program, inputs: LossInputs, weight: float) -> None:
        parameters = inputs.renderer.parameters
        count = parameters.contour_count
        losses = parameters.backend.array(wp.float32, count)
        program.launch(kernel, count, parameters.arrays, weight=weight, contour_loss=losses)

    return launch


IMAGE_LOSSES: tuple[Loss, ...] = (
    Loss(
        weight=lambda settings, canvas: 1.0,
        launch=_launch_image_error,
        reason="Mean squared error (paper eq. 12, first term) and, by ``Settings.ssim``, 1 - SSIM of small "
        "windows. On a transparent canvas the mean of the errors on black and on white: an image that is "
        "right on both is right on any background.",
    ),
)
"""The first one writes the gradient of the image, further ones add to it."""

SHAPE_LOSSES: tuple[Loss, ...] = (
    Loss(
        weight=lambda settings, canvas: settings.xing,
        launch=_launch_by_contour(shape.xing_backward),
        reason="Keeps outlines from crossing themselves (LIVE).",
    ),
    Loss(
        weight=lambda settings, canvas: settings.bending / (3 * canvas.width * canvas.height),
        launch=_launch_by_contour(shape.bending_backward),
        reason="Straightens burrs and loops too small for the image error to remove.",
    ),
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
