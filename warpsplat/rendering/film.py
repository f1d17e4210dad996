"""The compositing stage: lists and coverages -> image, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warpsplat.kernels import (
    composite,
    composite_opaque,
    composite_paint,
    composite_straight,
    constants,
    visibility,
)
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
    """sRGB in [0, 1]; of a transparent canvas premultiplied, and opacity."""
    image_grad: wp.array = buffer(column, "tiles", "planes", constants.TILE)
    inside: wp.array = buffer(column, "tiles", constants.TILE)
    """1 for pixels of the image, 0 for the padding."""


class Film:
    """What the shapes are composited on."""

    def __init__(self, backend: Backend, viewport: Viewport, canvas: Canvas, *, opaque: bool = False) -> None:
        """``opaque``: whether shapes of opacity 1 have gradients (``kernels.composite_opaque``)."""
        self._opaque = opaque
        self._backend, self._viewport = backend, viewport
        # Premultiplied, nothing is black.
        shown = np.zeros(3) if canvas.background is None else canvas.background
        self._background = wp.vec3(*(float(x) for x in shown))
        self.planes = 4 if canvas.background is None else 3
        sizes = {"tiles": viewport.tile_count, "planes": self.planes}
        self.buffers = backend.allocate(FilmBuffers, sizes)
        whole = np.ones((viewport.height, viewport.width, 1), np.float32)
        self.buffers.inside.assign(to_tiles(whole)[:, 0])

    @property
    def _dim(self) -> tuple[int, int]:
        return self._viewport.tile_count, self._backend.lanes

    def _is_plain(self, paint: Painting) -> bool:
        """Whether all is flat and opaque behind."""
        return self.planes == 3 and paint.is_flat

    def _light(self, bins: Bins) -> wp.array:
        """Where the adjoints of opaque shapes keep what light arrives at each slot."""
        return self._backend.array(column, bins.buffers.list_slot.shape[0], self._backend.lanes)

    def _launch(
        self,
        program: Program,
        kernel: wp.Kernel,
        bins: Bins,
        coverage: Coverage,
        paint: Painting,
        **more: Any,
    ) -> None:
        """Record a kernel that goes through each tile's list."""
        sources = (self.buffers, bins.buffers, coverage.buffers, paint.buffers)
        columns = self._backend.lane_size
        program.launch(kernel, self._dim, *sources, lane_columns=columns, split=True, **more)

    def forward(self, program: Program, bins: Bins, coverage: Coverage, paint: Painting) -> None:
        """Record lists and coverages -> ``image``."""
        plain = self._is_plain(paint)
        kernel = composite.composite_forward if plain else composite_paint.paint_forward
        self._launch(program, kernel, bins, coverage, paint, background=self._background)

    def backward(self, program: Program, bins: Bins, coverage: Coverage, paint: Painting) -> None:
        """Record ``image_grad`` -> gradients by slot, those of the coverages in their place."""
        plain = self._is_plain(paint)
        kernel = composite.composite_backward if plain else composite_paint.paint_backward
        more = {"law": coverage.law, "sum_grad": coverage.buffers.coverage}
        if self._opaque:
            kernel = composite_opaque.opaque_backward if plain else composite_opaque.opaque_paint_backward
            more |= {"background": self._background, "light": self._light(bins)}
        self._launch(program, kernel, bins, coverage, paint, **more)

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
        """Record what the squared error against ``target`` would grow by without each slot."""
        importance = self.buffers.inside if importance is None else importance
        more = {"target": target, "importance": importance, "slot_cost": slot_cost}
        self._launch(program, composite.removal_cost, bins, coverage, paint, **more)

    def visibility(
        self, program: Program, bins: Bins, coverage: Coverage, paint: Painting, seen: wp.array
    ) -> None:
        """Record what each pixel of a slot shows of its shape."""
        program.launch(
            visibility.visibility,
            self._dim,
            bins.buffers,
            coverage.buffers,
            paint.buffers,
            lane_columns=self._backend.lane_size,
            seen=seen,
            split=True,
        )


class StraightFilm(Film):
    """A transparent one whose colours are not premultiplied (``kernels.composite_straight``)."""

    def __init__(self, backend: Backend, viewport: Viewport, canvas: Canvas) -> None:
        super().__init__(backend, viewport, canvas, opaque=True)
        self._hit = backend.array(column, viewport.tile_count, constants.TILE)

    def forward(self, program: Program, bins: Bins, coverage: Coverage, paint: Painting) -> None:
        """See ``Film``."""
        self._launch(program, composite_straight.straight_forward, bins, coverage, paint, hit=self._hit)

    def backward(self, program: Program, bins: Bins, coverage: Coverage, paint: Painting) -> None:
        """See ``Film``."""
        more = {"law": coverage.law, "sum_grad": coverage.buffers.coverage}
        more |= {"hit": self._hit, "light": self._light(bins)}
        self._launch(program, composite_straight.straight_backward, bins, coverage, paint, **more)
