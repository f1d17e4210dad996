"""The outline stage: shapes -> polylines, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import warp as wp

from warpsplat.kernels import constants, outline
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.program import Program
from warpsplat.rendering.ranges import record_ranges

if TYPE_CHECKING:
    from warpsplat.rendering.stroker import Stroker


@dataclass
class OutlineBuffers:
    """Arrays that the stage owns."""

    bezier_range: wp.array = buffer(wp.vec2i, "beziers")
    """The straight pieces of each Bézier, counted in its shape's vertices."""
    vertex_count: wp.array = buffer(wp.int32, "shapes")
    vertex_ends: wp.array = buffer(wp.int32, "shapes")
    vertex_range: wp.array = buffer(wp.vec2i, "shapes")
    """First, and one past the last."""
    vertex_shape: wp.array = buffer(wp.int32, "vertices")
    vertex_next: wp.array = buffer(wp.int32, "vertices")
    """End of the edge that starts at a vertex."""
    vertex: wp.array = buffer(wp.vec2, "vertices")
    """[px]"""
    extent: wp.array = buffer(wp.vec2, "vertices")
    """How far the shape may reach beyond the vertex [px]."""
    start_grad: wp.array = buffer(wp.vec2, "vertices")
    """Gradient of the first end of the edge that starts at a vertex."""
    end_grad: wp.array = buffer(wp.vec2, "vertices")
    """Gradient of its second end."""
    half_grad: wp.array = buffer(wp.float32, "vertices")
    """Gradient of half a stroke's width, by edge."""


class Outline:
    """Flattens curves as finely as their size in pixels asks for."""

    def __init__(self, inputs: StageInputs, *, slack: float = 1.0) -> None:
        """``slack``: how much further from the curves the polylines may be than ``constants.FLATNESS``."""
        parameters = inputs.parameters
        self._parameters = parameters
        self._capacity, self._needed, self._slack = inputs.samples, inputs.needed, slack
        sizes = {"beziers": parameters.bezier_count, "shapes": parameters.shape_count}
        self.buffers = inputs.backend.allocate(OutlineBuffers, sizes | {"vertices": inputs.samples})
        self._sources = (self.buffers, parameters.arrays, inputs.viewport)
        self.stroker: Stroker | None = None
        """Stage of the strokes that are drawn as polygons."""
        if constants.STYLED in parameters.parts:
            from warpsplat.rendering.stroker import Stroker  # brings kernels that few scenes need

            self.stroker = Stroker(inputs, self.buffers)

    def samples(self) -> dict[str, wp.array]:
        """Return the samples that tiles are found from, as ``bins.rectangles`` takes them."""
        b = self.buffers
        return {"sample_range": b.vertex_range, "position": b.vertex, "extent": b.extent}

    def forward(self, program: Program) -> None:
        """Record points, widths -> vertices."""
        b, p = self.buffers, self._parameters
        program.launch(outline.plan_outline, p.shape_count, *self._sources, slack=self._slack)
        ranges = (b.vertex_count, b.vertex_ends, b.vertex_range)
        record_ranges(program, *ranges, self._needed, capacity=self._capacity)
        program.launch(outline.outline_forward, p.bezier_count, *self._sources, split=True)
        if self.stroker:
            self.stroker.forward(program)

    def backward(self, program: Program) -> None:
        """Record gradients of the edges' ends -> gradients of the points."""
        points = self._parameters.point_count
        program.launch(outline.outline_backward, points, *self._sources, split=True)
