"""The stage between outlines and coverage of styled strokes: centre lines -> polygons, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warpsplat.kernels import corners
from warpsplat.kernels.stroker.walk import walk_strokes
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.program import Program
from warpsplat.rendering.ranges import record_ranges


@dataclass
class StrokerBuffers:
    """Arrays that the stage owns."""

    corner_count: wp.array = buffer(wp.int32, "shapes")
    corner_ends: wp.array = buffer(wp.int32, "shapes")
    corner_range: wp.array = buffer(wp.vec2i, "shapes")
    """First, and one past the last."""
    corner_segments: wp.array = buffer(wp.vec2i, "corners")
    """Segments of the centre line that a corner hangs on."""
    corner_place: wp.array = buffer(wp.vec4, "corners")
    """Position relative to these, see ``kernels.corners``."""
    corner_shape: wp.array = buffer(wp.int32, "corners")
    corner_next: wp.array = buffer(wp.int32, "corners")
    corner: wp.array = buffer(wp.vec2, "corners")
    """[px]"""
    corner_start_grad: wp.array = buffer(wp.vec2, "corners")
    """Gradient of the first end of the edge that starts at a corner."""
    corner_end_grad: wp.array = buffer(wp.vec2, "corners")
    """Gradient of its second end."""
    segment_grad: wp.array = buffer(wp.vec3, "corners")
    """Gradients of the turn and the length of each segment of centre lines, and of the length before it."""


class Stroker:
    """Polygons of the strokes that are not round throughout."""

    def __init__(self, inputs: StageInputs, lines: object) -> None:
        """``lines``: buffers of the outline stage."""
        self._inputs = inputs
        sizes = {"shapes": inputs.parameters.shape_count, "corners": inputs.samples}
        self.buffers = inputs.backend.allocate(StrokerBuffers, sizes)
        self._sources = (self.buffers, lines, inputs.parameters.arrays, inputs.viewport)

    def edges(self) -> dict[str, wp.array]:
        """Return the polygons as the kernels of fills take outlines."""
        b = self.buffers
        return {
            "vertex": b.corner,
            "vertex_shape": b.corner_shape,
            "vertex_next": b.corner_next,
            "vertex_ends": b.corner_ends,
            "vertex_range": b.corner_range,
            "start_grad": b.corner_start_grad,
            "end_grad": b.corner_end_grad,
        }

    def forward(self, program: Program) -> None:
        """Record centre lines, widths -> corners; and how far these reach."""
        b, shapes = self.buffers, self._inputs.parameters.shape_count
        program.launch(walk_strokes, shapes, *self._sources, write=0, split=True)
        ranges = (b.corner_count, b.corner_ends, b.corner_range)
        record_ranges(program, *ranges, self._inputs.needed, capacity=self._inputs.samples)
        program.launch(walk_strokes, shapes, *self._sources, write=1, split=True)
        program.launch(corners.place_corners, self._inputs.samples, *self._sources, split=True)

    def backward(self, program: Program) -> None:
        """Record gradients of the polygons' edges -> of the segments' ends and of the widths."""
        shapes = self._inputs.parameters.shape_count
        program.launch(corners.corners_backward, shapes, *self._sources, split=True)
