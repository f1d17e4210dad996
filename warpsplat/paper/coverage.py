"""The coverage stage: Gaussians -> how much of each pixel a shape covers, and the adjoint."""

from __future__ import annotations

from typing import ClassVar

import warp as wp

from warpsplat.kernels import constants
from warpsplat.paper.grid import Grid
from warpsplat.paper.kernels import splat_coverage
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.coverage import CoverageBuffers
from warpsplat.rendering.program import Program


class SplatCoverage:
    """The paper's Gaussians: 1 - product of 1 - g."""

    mapping = constants.PRODUCT
    kernels: ClassVar[tuple[wp.Kernel, wp.Kernel]] = (
        splat_coverage.splat_forward,
        splat_coverage.splat_backward,
    )
    """Gaussians -> coverages, and its adjoint."""

    def __init__(self, inputs: StageInputs, grid: Grid) -> None:
        self._inputs, self._grid = inputs, grid
        self.buffers = inputs.backend.allocate(CoverageBuffers, {"slots": inputs.slots})
        self._sources = (self.buffers, inputs.bins.buffers, grid.buffers)

    def states(self, program: Program) -> None:
        """See ``Coverage``."""
        program.launch(
            self.kernels[0],
            (self._inputs.slots, self._inputs.backend.lanes),
            *self._sources,
            lanes=self._inputs.backend.lanes,
            split=True,
        )

    def values(self, program: Program) -> None:
        """See ``Coverage``: all are there."""

    def backward(self, program: Program) -> None:
        """See ``Coverage``: from the Gaussians on to the shapes' attributes."""
        program.launch(
            self.kernels[1],
            self._grid.buffers.mean.shape[0],
            *self._sources,
            sum_grad=self.buffers.coverage,
            split=True,
        )
        self._grid.backward(program)


class GaussianCoverage(SplatCoverage):
    """1 - product of 1 - o g."""

    kernels = (splat_coverage.soft_forward, splat_coverage.soft_backward)
