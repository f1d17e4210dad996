"""The compositing stage: lists and coverages -> image, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warpsplat.kernels import composite, composite_backward
from warpsplat.rendering.backend import Backend, Viewport, buffer
from warpsplat.rendering.bins import Bins
from warpsplat.rendering.coverage import Coverage
from warpsplat.rendering.paint import Painting
from warpsplat.rendering.program import Program
from warpsplat.rendering.tiles import to_tiles, write_tiles
from warpsplat.scene import Canvas


@dataclass
class FilmBuffers:
    """Images by tiles: [tile, channel, column]."""

    image: wp.array = buffer(None, "tiles", "planes", "columns")
    """sRGB in [0, 1]; on a transparent canvas premultiplied, unless straight, and opacity."""
    image_grad: wp.array = buffer(None, "tiles", "planes", "columns")
    inside: wp.array = buffer(None, "tiles", "columns")
    """1 for pixels of the image, 0 for the padding."""
    hit: wp.array = buffer(None, "straight_tiles", "columns")
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
        write_tiles(self.buffers.inside, to_tiles(whole)[:, 0])

    def attach(self, bins: Bins, coverage: Coverage, paint: Painting) -> None:
        """Composite the shapes of these stages from now on."""
        self._bins, self._coverage, self._paint = bins, coverage, paint

    def _painted(self) -> bool:
        """Return whether there is more than flat paints, on a background unless colours are straight: these
        have kernels of their own.
        """
        return (self.planes == 4 and not self._straight) or not self._paint.is_flat

    def _adjoint(self) -> wp.Kernel:
        """Return the adjoint of compositing."""
        column, painted = self._backend.column, self._painted()
        if not (self._straight or self._opaque):
            return composite_backward.make_backward(column, painted=painted)
        from warpsplat.kernels import composite_opaque  # which fits do not use

        return composite_opaque.make_backward(column, painted=painted, straight=self._straight)

    def launch(self, program: Program, kernel: wp.Kernel, **values: Any) -> None:
        """Record a kernel that goes through each tile's list."""
        dim = (self._viewport.tile_count, self._backend.lanes)
        numbers = {"lane_columns": self._backend.lane_columns, "background": self._background}
        stages = (self._bins.buffers, self._coverage.buffers, self._paint.buffers)
        program.launch(kernel, dim, self.buffers, *stages, numbers, values, split=True)

    def forward(self, program: Program) -> None:
        """Record lists and coverages -> ``image``."""
        column, painted = self._backend.column, self._painted()
        self.launch(program, composite.make_forward(column, painted=painted, straight=self._straight))

    def backward(self, program: Program) -> None:
        """Record ``image_grad`` -> gradients by slot, those of the coverages in their place."""
        coverage = self._coverage
        values: dict[str, Any] = {"mapping": coverage.mapping, "sum_grad": coverage.buffers.coverage}
        if self._opaque:
            slots = self._bins.buffers.list_slot.shape[0]
            values["transmittances"] = self._backend.array(self._backend.column, slots, self._backend.lanes)
        self.launch(program, self._adjoint(), **values)
