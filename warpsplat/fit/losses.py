"""Losses as launches: those of the image write or add to its gradient, those of the shapes add to theirs.

A further loss is a function in one of the two tuples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

from warpsplat.fit.settings import Settings
from warpsplat.kernels.loss import image, shape
from warpsplat.kernels.tile import column
from warpsplat.render.backend import Backend, Viewport, buffer
from warpsplat.render.parameters import Parameters
from warpsplat.render.program import Program
from warpsplat.render.renderer import Renderer
from warpsplat.render.tiles import to_tiles
from warpsplat.scene import FloatArray


@dataclass
class LossBuffers:
    """Sums that the losses leave, by tile."""

    loss: wp.array = buffer(wp.float32, "tiles", "lanes")
    """Squared errors."""
    similarity: wp.array = buffer(wp.float32, "tiles", 3)
    """SSIM x pixels, by channel."""


class Aim:
    """What the image is compared with, and how far it is from that."""

    def __init__(self, target: FloatArray, backend: Backend, viewport: Viewport) -> None:
        """``target``: sRGB in [0, 1], shape (height, width, 3), of the viewport's size."""
        self.target: wp.array = wp.array(to_tiles(target), dtype=column, device=backend.device)
        sizes = {"tiles": viewport.tile_count, "lanes": backend.lanes}
        self.buffers = backend.allocate(LossBuffers, sizes)
        self.value_count = 3 * viewport.pixel_count

    def at(self, target: FloatArray) -> None:
        """Another target from now on."""
        self.target.assign(to_tiles(target))

    def mean_square(self) -> float:
        """Mean squared error of the last step. Reads a number a tile back from the device."""
        return float(self.buffers.loss.numpy().sum(dtype="float64")) / self.value_count


@dataclass(frozen=True)
class LossInputs:
    """What a loss of the image may read."""

    renderer: Renderer
    aim: Aim
    settings: Settings
    clock: wp.array
    """Steps done, on the device, shape (1,)."""


def record_l2(program: Program, inputs: LossInputs) -> None:
    """Mean squared error (paper eq. 12, first term); the first loss, which writes the gradient."""
    backend = inputs.renderer.backend
    program.launch(
        image.l2_loss,
        (inputs.renderer.viewport.tile_count, backend.lanes),
        inputs.renderer.film.buffers,
        inputs.aim,
        inputs.aim.buffers,
        lane_columns=backend.lane_size,
        split=True,
    )


def record_ssim(program: Program, inputs: LossInputs) -> None:
    """1 - SSIM of small windows, where the settings weigh it."""
    if inputs.settings.ssim > 0:
        program.launch(
            image.ssim_backward,
            (inputs.renderer.viewport.tile_count, 3),
            inputs.renderer.film.buffers,
            inputs.aim,
            inputs.aim.buffers,
            clock=inputs.clock,
            weight=inputs.settings.ssim,
            split=True,
        )


def record_xing(program: Program, parameters: Parameters, settings: Settings) -> None:
    """Shapes that do not cross themselves (LIVE), where the settings weigh it."""
    if settings.xing > 0:
        program.launch(
            shape.xing_backward,
            parameters.shape_count,
            parameters.arrays,
            weight=settings.xing,
            shape_loss=parameters.backend.array(wp.float32, parameters.shape_count),
        )


def record_bending(program: Program, parameters: Parameters, settings: Settings) -> None:
    """Cubics that bend little, where the settings weigh it."""
    if settings.bending > 0:
        canvas = parameters.canvas
        program.launch(
            shape.bending_backward,
            parameters.shape_count,
            parameters.arrays,
            weight=settings.bending / (3 * canvas.width * canvas.height),
            shape_loss=parameters.backend.array(wp.float32, parameters.shape_count),
        )


IMAGE_LOSSES: tuple[Callable[[Program, LossInputs], None], ...] = (record_l2, record_ssim)
SHAPE_LOSSES: tuple[Callable[[Program, Parameters, Settings], None], ...] = (record_xing, record_bending)
