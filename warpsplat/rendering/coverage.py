"""The coverage stage: how much of each pixel a shape covers, as a viewer computes it, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.coverage import fill
from warpsplat.kernels.coverage.fill_backward import fill_backward
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.outline import Outline
from warpsplat.rendering.program import Program


@dataclass
class CoverageBuffers:
    """Arrays that every model owns: a tile of floats a slot, as columns and, in the same memory, as
    pixels.
    """

    coverage: wp.array = buffer(None, "slots", "columns")
    """After the adjoint of compositing, the gradient of the sum that the coverage came from."""
    coverage_pixels: wp.array = buffer(wp.float32, "slots", constants.TILE_PIXELS, memory_of="coverage")


class Coverage(Protocol):
    """Interface of a coverage model."""

    buffers: CoverageBuffers
    mapping: int
    """``constants.AREA`` or ``constants.PRODUCT``."""

    def states(self, program: Program) -> None:
        """Record slots -> their states, with coverages where those come first."""

    def values(self, program: Program) -> None:
        """Record visible slots -> coverages that are not there yet."""

    def backward(self, program: Program) -> None:
        """Record gradients in the coverages' place -> gradients of the samples."""


@dataclass
class ExactBuffers(CoverageBuffers):
    """Further arrays for fills and for strokes."""

    slot_winding: wp.array = buffer(wp.int32, "fill_slots")
    """Winding number of slots that no edge touches."""
    slot_near: wp.array = buffer(wp.int32, "stroke_slots", "row_lanes")
    segment_box: wp.array = buffer(wp.vec4, "segments")
    """Borders of the rectangle of pixels that a stroke's segment may be nearest to."""
    segment_ends: wp.array = buffer(wp.vec4, "segments")
    segment_sides: wp.array = buffer(wp.vec2, "segments")
    segment: wp.array = buffer(wp.int32, "stroke_slots", constants.TILE_PIXELS)
    """Nearest segment of each pixel."""


class ExactCoverage:
    """The area that a viewer computes, from polylines.

    Fills, and styled strokes as polygons, by signed area: states first, then coverages of what is seen. Round
    strokes by distance: states and coverages in one go.
    """

    mapping = constants.AREA

    def __init__(self, inputs: StageInputs, outline: Outline) -> None:
        self._inputs, self._outline = inputs, outline
        self._parts = inputs.parameters.parts
        slots, lanes = inputs.slots, inputs.backend.row_lanes
        sizes = {"slots": slots, "row_lanes": lanes, "fill_slots": slots, "stroke_slots": 0, "segments": 0}
        if constants.STROKE in self._parts:
            sizes |= {"stroke_slots": slots, "segments": inputs.samples}
        self.buffers: CoverageBuffers = inputs.backend.allocate(ExactBuffers, sizes)
        arrays = inputs.parameters.arrays
        self._edges: dict[int, tuple[object, ...]] = dict.fromkeys(self._parts, (outline.buffers, arrays))
        if outline.stroker:
            nonzero = inputs.backend.array(wp.int32, inputs.parameters.shape_count)
            self._edges[constants.STYLED] = (outline.stroker.edges(), arrays | {"rule": nonzero})
        self._blocks = -(-inputs.samples // constants.EDGE_BLOCK)
        for part in self._parts:
            if part != constants.STROKE:
                self._edges[part] += ({"reach": inputs.backend.array(wp.vec2, self._blocks)},)

    def _launch(
        self, program: Program, part: int, kernel: wp.Kernel, dim: int | tuple[int, int], **values: Any
    ) -> None:
        sources = (self.buffers, self._inputs.bins.buffers, self._inputs.viewport, *self._edges[part])
        program.launch(kernel, dim, *sources, split=True, **values)

    def states(self, program: Program) -> None:
        """See ``Coverage``."""
        slots, backend = self._inputs.slots, self._inputs.backend
        for part in self._parts:
            if part == constants.STROKE:
                from warpsplat.kernels.coverage import stroke  # brings kernels that fills do not need

                self._launch(program, part, stroke.segment_rectangles, self._inputs.samples)
                kernel = stroke.make_forward(backend.column)
                self._launch(program, part, kernel, (slots, backend.row_lanes))
            else:
                self._launch(program, part, fill.find_reach, self._blocks)
                self._launch(program, part, fill.fill_states, slots, own_part=part)

    def values(self, program: Program) -> None:
        """See ``Coverage``."""
        backend = self._inputs.backend
        for part in self._parts:
            if part != constants.STROKE:
                kernel = fill.make_forward(backend.column)
                self._launch(program, part, kernel, (self._inputs.slots, backend.row_lanes), own_part=part)

    def backward(self, program: Program) -> None:
        """Record gradients in the coverages' place -> gradients of the points and widths."""
        edges, gradient = self._inputs.samples, self.buffers.coverage_pixels
        arrays = self._inputs.parameters.arrays
        for part in self._parts:
            if part == constants.STROKE:
                from warpsplat.kernels.coverage import stroke

                self._launch(program, part, stroke.stroke_backward, edges, sum_grad=gradient)
                shapes, lines = self._inputs.parameters.shape_count, self._outline.buffers
                program.launch(stroke.widths_backward, shapes, arrays, lines, self._inputs.viewport)
            else:
                self._launch(program, part, fill_backward, edges, own_part=part, sum_grad=gradient)
        if self._outline.stroker:
            self._outline.stroker.backward(program)
        self._outline.backward(program)
