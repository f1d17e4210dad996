"""The coverage stage: how much of each pixel a shape covers, as a viewer computes it, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.coverage import fill, stroke
from warpsplat.kernels.tile import column
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.outline import Outline
from warpsplat.rendering.program import Program


@dataclass
class CoverageBuffers:
    """Arrays that every model owns: a tile of floats a slot, as columns and, in the same memory, as
    pixels.
    """

    coverage: wp.array = buffer(column, "slots", constants.TILE)
    """After the adjoint of compositing, the gradient of the sum that the coverage came from."""
    coverage_pixels: wp.array = buffer(wp.float32, "slots", constants.TILE_PIXELS, memory_of="coverage")


@dataclass
class FillBuffers:
    """Further arrays for fills."""

    slot_winding: wp.array = buffer(wp.int32, "slots")
    """Winding number of slots that no edge touches."""


@dataclass
class StrokeBuffers:
    """Further arrays for strokes."""

    slot_near: wp.array = buffer(wp.int32, "slots", "lanes")
    segment: wp.array = buffer(wp.int32, "slots", constants.TILE_PIXELS)
    """Nearest segment of each pixel."""


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


@dataclass(frozen=True)
class ExactStages:
    """Stages that the parts of exact coverage read and write."""

    inputs: StageInputs
    outline: Outline
    coverage: CoverageBuffers

    @property
    def sources(self) -> tuple[object, ...]:
        """Return the objects in which launches find their arrays."""
        i = self.inputs
        return self.coverage, i.bins.buffers, self.outline.buffers, i.parameters.arrays, i.viewport


class FillCoverage:
    """Fills by signed area: states first, then coverages of what is seen."""

    part = constants.FILL

    def __init__(self, stages: ExactStages) -> None:
        self._stages = stages
        self.buffers = stages.inputs.backend.allocate(FillBuffers, {"slots": stages.inputs.slots})
        self._sources = (*stages.sources, self.buffers)
        self._edges = stages.outline.buffers.vertex.shape[0]

    def states(self, program: Program) -> None:
        """See ``Coverage``."""
        program.launch(
            fill.fill_states, self._stages.inputs.slots, *self._sources, own_part=self.part, split=True
        )

    def values(self, program: Program) -> None:
        """See ``Coverage``."""
        backend = self._stages.inputs.backend
        program.launch(
            fill.fill_forward,
            (self._stages.inputs.slots, backend.lanes),
            *self._sources,
            own_part=self.part,
            lane_rows=backend.lane_size,
            split=True,
        )

    def backward(self, program: Program) -> None:
        """Record gradients in the coverages' place -> gradients of the edges' ends."""
        program.launch(
            fill.fill_backward,
            self._edges,
            *self._sources,
            own_part=self.part,
            sum_grad=self._stages.coverage.coverage_pixels,
            split=True,
        )


class StyledCoverage(FillCoverage):
    """Strokes as polygons, whose union is filled."""

    part = constants.STYLED

    def __init__(self, stages: ExactStages) -> None:
        super().__init__(stages)
        stroker = stages.outline.stroker
        assert stroker
        self._stroker = stroker
        nonzero = stages.inputs.backend.array(wp.int32, stages.inputs.parameters.shape_count)
        shapes = stages.inputs.parameters.arrays | {"rule": nonzero}
        self._sources = (
            stages.coverage,
            stages.inputs.bins.buffers,
            stroker.edges(),
            shapes,
            stages.inputs.viewport,
            self.buffers,
        )

    def backward(self, program: Program) -> None:
        """Record gradients in the coverages' place -> gradients of the centre lines and of the widths."""
        super().backward(program)
        self._stroker.backward(program)


class StrokeCoverage:
    """Round strokes by distance: states and coverages in one go."""

    def __init__(self, stages: ExactStages) -> None:
        self._stages = stages
        sizes = {"slots": stages.inputs.slots, "lanes": stages.inputs.backend.lanes}
        self.buffers = stages.inputs.backend.allocate(StrokeBuffers, sizes)

    def states(self, program: Program) -> None:
        """See ``Coverage``."""
        backend = self._stages.inputs.backend
        program.launch(
            stroke.stroke_forward,
            (self._stages.inputs.slots, backend.lanes),
            *self._stages.sources,
            self.buffers,
            lane_rows=backend.lane_size,
            split=True,
        )

    def values(self, program: Program) -> None:
        """Do nothing: all values are there."""

    def backward(self, program: Program) -> None:
        """Record gradients in the coverages' place -> gradients of the segments' ends and of the widths."""
        stages = self._stages
        program.launch(
            stroke.stroke_backward,
            stages.outline.buffers.vertex.shape[0],
            *stages.sources,
            self.buffers,
            sum_grad=stages.coverage.coverage_pixels,
            split=True,
        )
        program.launch(stroke.widths_backward, stages.inputs.parameters.shape_count, *stages.sources)


EXACT_PARTS: dict[int, type[FillCoverage] | type[StrokeCoverage]] = {
    constants.FILL: FillCoverage,
    constants.STROKE: StrokeCoverage,
    constants.STYLED: StyledCoverage,
}
"""Coverage of the shapes of each of ``Parameters.parts``."""


class ExactCoverage:
    """The area that a viewer computes, from polylines: a part for each kind of shape in the scene."""

    mapping = constants.AREA

    def __init__(self, inputs: StageInputs, outline: Outline) -> None:
        self.buffers = inputs.backend.allocate(CoverageBuffers, {"slots": inputs.slots})
        self._outline = outline
        stages = ExactStages(inputs, outline, self.buffers)
        self.parts = [EXACT_PARTS[part](stages) for part in inputs.parameters.parts]

    def states(self, program: Program) -> None:
        """See ``Coverage``."""
        for part in self.parts:
            part.states(program)

    def values(self, program: Program) -> None:
        """See ``Coverage``."""
        for part in self.parts:
            part.values(program)

    def backward(self, program: Program) -> None:
        """Record gradients in the coverages' place -> gradients of the points."""
        for part in self.parts:
            part.backward(program)
        self._outline.backward(program)
