"""The paper's own model: shapes -> soft Gaussians, each of its own strength -> coverage, and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warpsplat.paper.grid import Grid, GridBuffers
from warpsplat.paper.kernels import fill, gaussians, soft
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.program import Program
from warpsplat.scene import GRADIENTS, Kind


@dataclass
class SoftBuffers(GridBuffers):
    """Buffers of the stage."""

    strength: wp.array = buffer(wp.float32, "gaussians")
    strength_grad: wp.array = buffer(wp.float32, "gaussians")
    gaussian_width_grad: wp.array = buffer(wp.float32, "gaussians")
    paint_opacities: wp.array = buffer(wp.float32, "shapes")
    """All 1, for compositing: the shapes' opacities are in their coverages."""


class SoftGrid(Grid):
    """Puts a grid of Gaussians along and across each fill, a row along each stroke."""

    buffers: SoftBuffers
    owned = SoftBuffers

    def __init__(
        self, inputs: StageInputs, *, softness: float, density: float, through_scales: bool, fold: float
    ) -> None:
        """Allocate.

        Raises:
            ValueError: a fill has an odd number of cubics, and so no two chains (paper section 3.2); or a
                gradient, whose opacities would count besides the Gaussians'.
        """
        if inputs.parameters.paints & set(GRADIENTS):
            raise ValueError("soft Gaussians have flat colours, no gradients")
        super().__init__(inputs, through_scales=through_scales, fold=fold)
        self._softness, self._density = softness, density
        self.buffers.paint_opacities.fill_(1.0)

    def forward(self, program: Program) -> None:
        """Record points, widths, opacities -> Gaussians."""
        p = self._parameters
        program.launch(soft.plan_soft, p.shape_count, *self._sources, density=self._density, split=True)
        self._number(program)
        kernels = {Kind.FILL: fill.fill_grid_forward, Kind.STROKE: soft.soft_stroke_forward}
        for kind in sorted(p.kinds):
            program.launch(kernels[kind], self._capacity, *self._sources, split=True)
        program.launch(
            soft.soft_gaussians_forward, self._capacity, *self._sources, softness=self._softness, split=True
        )

    def backward(self, program: Program) -> None:
        """Record gradients of means, conics and strengths -> gradients of the shapes' attributes."""
        b, p = self.buffers, self._parameters
        program.launch(
            soft.soft_differences_backward,
            self._capacity,
            *self._sources,
            softness=self._softness,
            through_scales=float(self._through_scales),
            fold_factor=self._fold / self._viewport.pixel_count,
            split=True,
        )
        program.launch(gaussians.positions_backward, self._capacity, b, split=True)
        if Kind.FILL in p.kinds:
            program.launch(fill.fill_stations_backward, self._capacity, *self._sources, split=True)
            program.launch(fill.fill_points_backward, p.point_count, *self._sources, split=True)
        if Kind.STROKE in p.kinds:
            program.launch(soft.soft_stroke_backward, p.point_count, *self._sources, split=True)
        program.launch(soft.soft_shapes_backward, p.shape_count, *self._sources, split=True)
