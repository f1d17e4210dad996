"""The coverage stage: how much of each pixel a shape covers, and the adjoint.

Two models fill the same arrays: the area that a viewer computes for a path, and the paper's Gaussians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.coverage import fill, splat, stroke
from warpsplat.kernels.tile import column
from warpsplat.render.backend import Backend, Viewport, buffer
from warpsplat.render.bins import Bins
from warpsplat.render.grid import Grid
from warpsplat.render.outline import Outline
from warpsplat.render.parameters import Parameters
from warpsplat.render.program import Program
from warpsplat.scene import Kind


@dataclass
class CoverageBuffers:
    """What every model owns: a tile of floats a slot, as columns and, in the same memory, as pixels."""

    coverage: wp.array = buffer(column, "slots", constants.TILE)
    """After the adjoint of compositing, the gradient of the sum that the coverage came from."""
    coverage_pixels: wp.array = buffer(wp.float32, "slots", constants.TILE_PIXELS, memory_of="coverage")


@dataclass
class FillBuffers:
    """What fills need besides."""

    slot_winding: wp.array = buffer(wp.int32, "slots")
    """Of slots that no edge touches."""


@dataclass
class StrokeBuffers:
    """What strokes need besides."""

    slot_near: wp.array = buffer(wp.int32, "slots", "lanes")
    segment: wp.array = buffer(wp.int32, "slots", constants.TILE_PIXELS)
    """Nearest segment of each pixel."""


class Coverage(Protocol):
    """What compositing asks of a model."""

    buffers: CoverageBuffers
    law: int
    """``constants.AREA`` or ``constants.PRODUCT``."""

    def states(self, program: Program) -> None:
        """Record slots -> their states, with coverages where those come first."""

    def values(self, program: Program) -> None:
        """Record visible slots -> coverages that are not there yet."""

    def backward(self, program: Program) -> None:
        """Record gradients in the coverages' place -> gradients of the samples."""


class ExactCoverage:
    """The area that a viewer computes: fills by signed area, strokes by distance, both of polylines."""

    law = constants.AREA

    def __init__(
        self,
        backend: Backend,
        parameters: Parameters,
        viewport: Viewport,
        outline: Outline,
        bins: Bins,
        slots: int,
    ) -> None:
        self._backend, self._parameters = backend, parameters
        self._outline, self._slots = outline, slots
        sizes = {"slots": slots, "lanes": backend.lanes}
        self.buffers = backend.allocate(CoverageBuffers, sizes)
        self._sources = (self.buffers, bins.buffers, outline.buffers, viewport)
        self.fill = backend.allocate(FillBuffers, sizes if Kind.FILL in parameters.kinds else NONE)
        self.stroke = backend.allocate(StrokeBuffers, sizes if Kind.STROKE in parameters.kinds else NONE)

    def states(self, program: Program) -> None:
        """See ``Coverage``: strokes find state and coverage in one go."""
        kinds, p = self._parameters.kinds, self._parameters.arrays
        if Kind.FILL in kinds:
            program.launch(
                fill.fill_states, self._slots, *self._sources, self.fill, kind=p["kind"], split=True
            )
        if Kind.STROKE in kinds:
            program.launch(
                stroke.stroke_forward,
                (self._slots, self._backend.lanes),
                *self._sources,
                self.stroke,
                p,
                lane_rows=self._backend.lane_size,
                split=True,
            )

    def values(self, program: Program) -> None:
        """See ``Coverage``: fills that nothing is seen of are left out."""
        if Kind.FILL in self._parameters.kinds:
            program.launch(
                fill.fill_forward,
                (self._slots, self._backend.lanes),
                *self._sources,
                self.fill,
                kind=self._parameters.arrays["kind"],
                lane_rows=self._backend.lane_size,
                split=True,
            )

    def backward(self, program: Program) -> None:
        """See ``Coverage``: gradients of the edges' ends and of the widths."""
        p = self._parameters
        edges = self._outline.buffers.vertex.shape[0]
        gradient = self.buffers.coverage_pixels
        if Kind.FILL in p.kinds:
            program.launch(
                fill.fill_backward,
                edges,
                *self._sources,
                kind=p.arrays["kind"],
                sum_grad=gradient,
                split=True,
            )
        if Kind.STROKE in p.kinds:
            program.launch(
                stroke.stroke_backward,
                edges,
                *self._sources,
                self.stroke,
                p.arrays,
                sum_grad=gradient,
                split=True,
            )
            program.launch(stroke.widths_backward, p.shape_count, *self._sources, p.arrays)
        self._outline.backward(program)


NONE = {"slots": 0, "lanes": 0}
"""Sizes of what no shape needs."""


class SplatCoverage:
    """The paper's Gaussians: 1 - product of 1 - g."""

    law = constants.PRODUCT

    def __init__(self, backend: Backend, grid: Grid, bins: Bins, slots: int) -> None:
        self._backend, self._grid, self._slots = backend, grid, slots
        self.buffers = backend.allocate(CoverageBuffers, {"slots": slots})
        self._sources = (self.buffers, bins.buffers, grid.buffers)

    def states(self, program: Program) -> None:
        """See ``Coverage``."""
        program.launch(
            splat.splat_forward,
            (self._slots, self._backend.lanes),
            *self._sources,
            lanes=self._backend.lanes,
            split=True,
        )

    def values(self, program: Program) -> None:
        """See ``Coverage``: all are there."""

    def backward(self, program: Program) -> None:
        """See ``Coverage``: gradients of means and conics."""
        program.launch(
            splat.splat_backward,
            self._grid.buffers.mean.shape[0],
            *self._sources,
            sum_grad=self.buffers.coverage,
            split=True,
        )
        self._grid.backward(program)
