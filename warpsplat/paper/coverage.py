"""The coverage stage: Gaussians -> how much of each pixel a shape covers, and the adjoint."""

from __future__ import annotations

from warpsplat.kernels import constants
from warpsplat.paper.grid import Grid
from warpsplat.paper.kernels import splat_coverage
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.coverage import CoverageBuffers
from warpsplat.rendering.program import Program


class GaussianCoverage:
    """The paper's Gaussians: 1 - product of 1 - g, of soft ones 1 - product of 1 - o g."""

    mapping = constants.PRODUCT

    def __init__(self, inputs: StageInputs, grid: Grid) -> None:
        self._inputs, self._grid, self._is_soft = inputs, grid, grid.softness is not None
        self.buffers = inputs.backend.allocate(CoverageBuffers, {"slots": inputs.slots})
        self._sources = (self.buffers, inputs.bins.buffers, grid.buffers)

    def states(self, program: Program) -> None:
        """See ``Coverage``."""
        backend = self._inputs.backend
        program.launch(
            splat_coverage.make_forward(backend.column, soft=self._is_soft),
            (self._inputs.slots, backend.lanes),
            *self._sources,
            lanes=backend.lanes,
            split=True,
        )

    def values(self, program: Program) -> None:
        """See ``Coverage``: all are there."""

    def backward(self, program: Program) -> None:
        """See ``Coverage``: from the Gaussians on to the shapes' attributes."""
        program.launch(
            splat_coverage.make_backward(self._inputs.backend.column, soft=self._is_soft),
            self._grid.buffers.mean.shape[0],
            *self._sources,
            sum_grad=self.buffers.coverage,
            split=True,
        )
        self._grid.backward(program)
