"""The compositing stage: lists and coverages -> image, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warpsplat.kernels import composite, composite_backward, composite_opaque, constants
from warpsplat.kernels.tile import column
from warpsplat.rendering.backend import Backend, Viewport, buffer
from warpsplat.rendering.bins import Bins
from warpsplat.rendering.coverage import Coverage
from warpsplat.rendering.paint import Painting
from warpsplat.rendering.program import Program
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import Canvas


@dataclass
class FilmBuffers:
    """Images by tiles: [tile, channel, column]."""

    image: wp.array = buffer(column, "tiles", "planes", constants.TILE)
    """sRGB in [0, 1]; on a transparent canvas premultiplied, unless straight, and opacity."""
    image_grad: wp.array = buffer(column, "tiles", "planes", constants.TILE)
    inside: wp.array = buffer(column, "tiles", constants.TILE)
    """1 for pixels of the image, 0 for the padding."""
    hit: wp.array = buffer(column, "straight_tiles", constants.TILE)
    """Part of each pixel that shapes lie on, where colours are straight."""


class Film:
    """The image that shapes are composited on."""

    def __init__(
        self,
        backend: Backend,
        viewport: Viewport,
        canvas: Canvas,
        *,
        opaque: bool = False,
        straight: bool = False,
    ) -> None:
        """Allocate the images.

        Args:
            backend: the device.
            viewport: the image.
            canvas: has the background; a transparent one is black.
            opaque: whether shapes of opacity 1 have gradients (``kernels.composite_opaque``).
            straight: whether colours are not premultiplied; on a transparent canvas, with any opacities.
        """
        self._backend, self._viewport = backend, viewport
        self._opaque, self._straight = opaque, straight
        shown = np.zeros(3) if canvas.background is None else canvas.background
        self._background = wp.vec3(*(float(x) for x in shown))
        self.planes = 4 if canvas.background is None else 3
        tiles = viewport.tile_count
        sizes = {"tiles": tiles, "planes": self.planes, "straight_tiles": tiles if straight else 1}
        self.buffers = backend.allocate(FilmBuffers, sizes)
        whole = np.ones((viewport.height, viewport.width, 1), np.float32)
        self.buffers.inside.assign(to_tiles(whole)[:, 0])

    def _kernels(self, paint: Painting) -> tuple[wp.Kernel, wp.Kernel]:
        """Return the forward pass and its adjoint: those of flat paints on a background where that is all."""
        if self._straight:
            return composite.straight_forward, composite_opaque.straight_backward
        if self.planes == 3 and paint.is_flat:
            usual, opaque = composite_backward.composite_backward, composite_opaque.opaque_backward
            return composite.composite_forward, opaque if self._opaque else usual
        usual, opaque = composite_backward.paint_backward, composite_opaque.opaque_paint_backward
        return composite.paint_forward, opaque if self._opaque else usual

    def _launch(
        self,
        program: Program,
        kernel: wp.Kernel,
        bins: Bins,
        coverage: Coverage,
        paint: Painting,
        **values: Any,
    ) -> None:
        """Record a kernel that goes through each tile's list."""
        dim = (self._viewport.tile_count, self._backend.lanes)
        numbers = {"lane_columns": self._backend.lane_size, "background": self._background}
        sources = (self.buffers, bins.buffers, coverage.buffers, paint.buffers, numbers, values)
        program.launch(kernel, dim, *sources, split=True)

    def forward(self, program: Program, bins: Bins, coverage: Coverage, paint: Painting) -> None:
        """Record lists and coverages -> ``image``."""
        self._launch(program, self._kernels(paint)[0], bins, coverage, paint)

    def backward(self, program: Program, bins: Bins, coverage: Coverage, paint: Painting) -> None:
        """Record ``image_grad`` -> gradients by slot, those of the coverages in their place."""
        values: dict[str, Any] = {"mapping": coverage.mapping, "sum_grad": coverage.buffers.coverage}
        if self._opaque:
            slots = bins.buffers.list_slot.shape[0]
            values["transmittances"] = self._backend.array(column, slots, self._backend.lanes)
        self._launch(program, self._kernels(paint)[1], bins, coverage, paint, **values)

    def removal_cost(
        self,
        program: Program,
        bins: Bins,
        coverage: Coverage,
        paint: Painting,
        target: wp.array,
        importance: wp.array | None,
        slot_cost: wp.array,
    ) -> None:
        """Record by how much the squared error against ``target`` would grow without each slot."""
        importance = self.buffers.inside if importance is None else importance
        values = {"target": target, "importance": importance, "slot_cost": slot_cost}
        self._launch(program, composite.removal_cost, bins, coverage, paint, **values)

    def visibility(
        self, program: Program, bins: Bins, coverage: Coverage, paint: Painting, seen: wp.array
    ) -> None:
        """Record how much each pixel of a slot shows of its shape."""
        self._launch(program, composite.visibility, bins, coverage, paint, seen=seen)
