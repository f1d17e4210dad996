"""Losses as launches: those of the image write or add to its gradient, those of the shapes add to theirs.

A further loss is a function in one of the two tuples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsplat.fit.settings import Settings
from warpsplat.kernels.loss import alpha, image, shape
from warpsplat.kernels.tile import column
from warpsplat.rendering.backend import Backend, Viewport, buffer
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import Renderer
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import FloatArray


@dataclass
class LossBuffers:
    """Sums that the losses leave, by tile and channel."""

    loss: wp.array = buffer(wp.float32, "tiles", 3)
    """Squared errors, each of the same weight; below 0 where they are not known yet."""
    similarity: wp.array = buffer(wp.float32, "tiles", 3)
    """SSIM x weight."""


class Aim:
    """What the image is compared with, and how far it is from that."""

    def __init__(
        self, target: FloatArray, backend: Backend, viewport: Viewport, importance: FloatArray | None = None
    ) -> None:
        """What a step is to come near to.

        Args:
            target: sRGB in [0, 1], shape (height, width, 3), of the viewport's size; or premultiplied with
                opacity, shape (height, width, 4).
            backend: where to compute.
            viewport: of the render.
            importance: how much the error of a pixel counts, shape (height, width), mean 1; without, all do
                alike.
        """
        self.target: wp.array = wp.array(to_tiles(target), dtype=column, device=backend.device)
        self.weighted = importance is not None
        weights = np.ones(target.shape[:2], np.float32) if importance is None else importance
        self.importance: wp.array = wp.array(
            to_tiles(weights[..., None])[:, 0], dtype=column, device=backend.device
        )
        self.moved = False
        """Whether it is at another target than at first."""
        self.buffers = backend.allocate(LossBuffers, {"tiles": viewport.tile_count})
        self.buffers.loss.fill_(-1.0)
        self.value_count = 3 * viewport.pixel_count

    def at(self, target: FloatArray) -> None:
        """Another target from now on."""
        self.target.assign(to_tiles(target))
        self.buffers.loss.fill_(-1.0)
        self.moved = True

    def mean_square(self) -> float:
        """Mean squared error of the last step, unweighted. Reads a number a tile back from the device."""
        return float(self.buffers.loss.numpy().sum(dtype="float64")) / self.value_count


@dataclass(frozen=True)
class LossInputs:
    """What a loss of the image may read."""

    renderer: Renderer
    aim: Aim
    settings: Settings
    clock: wp.array
    """Steps done, on the device, shape (1,)."""


def record_error(program: Program, inputs: LossInputs) -> None:
    """Mean squared error (paper eq. 12, first term), and as the settings weigh it 1 - SSIM of small windows.

    The first loss, which writes the gradient; both in one, since what they wait for is memory.
    """
    viewport = inputs.renderer.viewport
    if inputs.renderer.film.planes == 4:
        record_alpha(program, inputs)
        return
    program.launch(
        image.image_loss,
        (viewport.tile_count, 3),
        inputs.renderer.film.buffers,
        inputs.aim,
        inputs.aim.buffers,
        viewport,
        tile_cache=inputs.renderer.bins.buffers.tile_cache,
        clock=inputs.clock,
        similarity_weight=inputs.settings.ssim,
        split=True,
    )


def record_alpha(program: Program, inputs: LossInputs) -> None:
    """Mean squared error of a transparent picture, on black and on white: what is right on both is right on
    anything. Writes the gradient.
    """
    program.launch(
        alpha.alpha_loss,
        inputs.renderer.viewport.tile_count,
        inputs.renderer.film.buffers,
        inputs.aim,
        inputs.aim.buffers,
        tile_cache=inputs.renderer.bins.buffers.tile_cache,
        split=True,
    )


def record_xing(program: Program, parameters: Parameters, settings: Settings) -> None:
    """Shapes that do not cross themselves (LIVE), where the settings weigh it."""
    if settings.xing > 0:
        program.launch(
            shape.xing_backward,
            parameters.contour_count,
            parameters.arrays,
            weight=settings.xing,
            contour_loss=parameters.backend.array(wp.float32, parameters.contour_count),
        )


def record_bending(program: Program, parameters: Parameters, settings: Settings) -> None:
    """Cubics that bend little, where the settings weigh it."""
    if settings.bending > 0:
        canvas = parameters.canvas
        program.launch(
            shape.bending_backward,
            parameters.contour_count,
            parameters.arrays,
            weight=settings.bending / (3 * canvas.width * canvas.height),
            contour_loss=parameters.backend.array(wp.float32, parameters.contour_count),
        )


IMAGE_LOSSES: tuple[Callable[[Program, LossInputs], None], ...] = (record_error,)
SHAPE_LOSSES: tuple[Callable[[Program, Parameters, Settings], None], ...] = (record_xing, record_bending)
