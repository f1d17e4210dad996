"""The grid stage: shapes -> Gaussians (the paper's model), and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import warp as wp

from warpsplat.paper.chains import check_chains
from warpsplat.paper.kernels import fill, gaussians, plan, soft, stroke
from warpsplat.paper.kernels.strips import ShapeGrid
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.program import Program
from warpsplat.rendering.ranges import record_ranges
from warpsplat.scene import GRADIENTS, Kind


@dataclass
class GridBuffers:
    """Buffers of the stage."""

    shape_grid: wp.array = buffer(ShapeGrid, "shapes")
    """How many Gaussians each shape has along and across."""
    gaussian_count: wp.array = buffer(wp.int32, "shapes")
    gaussian_ends: wp.array = buffer(wp.int32, "shapes")
    gaussian_range: wp.array = buffer(wp.vec2i, "shapes")
    """First, and one past the last."""
    gaussian_shape: wp.array = buffer(wp.int32, "gaussians")
    """-1 for those not in use."""
    gaussian_across: wp.array = buffer(wp.float32, "gaussians")
    """Fraction of the way across the strip."""
    mean: wp.array = buffer(wp.vec2, "gaussians")
    """[px]"""
    conic: wp.array = buffer(wp.vec3, "gaussians")
    """Inverse covariance [px^-2]."""
    extent: wp.array = buffer(wp.vec2, "gaussians")
    """Half size of the box outside of which a Gaussian is cut [px]."""
    cut: wp.array = buffer(wp.float32, "gaussians")
    """Squared Mahalanobis distance of the cut."""
    mean_grad: wp.array = buffer(wp.vec2, "gaussians")
    conic_grad: wp.array = buffer(wp.vec3, "gaussians")
    along_grad: wp.array = buffer(wp.vec2, "gaussians")
    across_grad: wp.array = buffer(wp.vec2, "gaussians")
    position_grad: wp.array = buffer(wp.vec2, "gaussians")
    station_grad: wp.array = buffer(wp.vec2, "gaussians")
    station_width_grad: wp.array = buffer(wp.float32, "gaussians")
    strength: wp.array = buffer(wp.float32, "soft")
    """Opacity of each Gaussian; soft ones alone have any."""
    strength_grad: wp.array = buffer(wp.float32, "soft")
    gaussian_width_grad: wp.array = buffer(wp.float32, "soft")


class Softness(NamedTuple):
    """Options of soft Gaussians."""

    sigma: float
    """Standard deviation that every Gaussian has at least [canvas units]; a pixel's area adds to it."""
    density: float
    """Gaussians along and across a shape over their usual number."""


class GridKernels(NamedTuple):
    """Kernels that put one kind of shape on a grid, and their adjoints."""

    forward: wp.Kernel
    stations_backward: wp.Kernel | None
    points_backward: wp.Kernel


FILLS = GridKernels(fill.fill_grid_forward, fill.fill_stations_backward, fill.fill_points_backward)
STROKES = GridKernels(
    stroke.stroke_grid_forward, stroke.stroke_stations_backward, stroke.stroke_points_backward
)
ROWS = GridKernels(soft.soft_stroke_forward, None, soft.soft_stroke_backward)
"""Those of soft strokes, one row of Gaussians each."""


class Grid:
    """Puts a grid of Gaussians along and across each shape; soft ones in a row along each stroke."""

    def __init__(
        self, inputs: StageInputs, *, through_scales: bool, fold: float, softness: Softness | None = None
    ) -> None:
        """Allocate.

        Raises:
            ValueError: a fill has an odd number of cubics, and so no two chains (paper section 3.2); or a
                shape of soft ones a gradient, whose opacities would count besides the Gaussians'.
        """
        p = self._parameters = inputs.parameters
        self._capacity, self._needed = inputs.samples, inputs.needed
        self.softness = softness
        if softness and p.paints & set(GRADIENTS):
            raise ValueError("soft Gaussians have flat colours, no gradients")
        check_chains(p.structure)
        sizes = {
            "shapes": p.shape_count,
            "gaussians": inputs.samples,
            "soft": inputs.samples if softness else 0,
        }
        self.buffers = inputs.backend.allocate(GridBuffers, sizes)
        self._plan_scale = 1.0 if softness else inputs.viewport.scale
        options = {
            "soft": int(softness is not None),
            "density": softness.density if softness else 1.0,
            "softness": softness.sigma if softness else 0.0,
            "through_scales": float(through_scales),
            "fold_factor": fold / inputs.viewport.pixel_count,
        }
        self._sources = (self.buffers, p.arrays, inputs.viewport, options)
        kernels = {Kind.FILL: FILLS, Kind.STROKE: ROWS if softness else STROKES}
        self._kernels = [kernels[kind] for kind in sorted(p.kinds)]

    def samples(self) -> dict[str, wp.array]:
        """Return the parameters of ``bins.rectangles``."""
        b = self.buffers
        return {"sample_range": b.gaussian_range, "position": b.mean, "extent": b.extent}

    def _launch(self, program: Program, kernel: wp.Kernel, dim: int, **values: float) -> None:
        program.launch(kernel, dim, *self._sources, split=True, **values)

    def forward(self, program: Program) -> None:
        """Record points, widths -> Gaussians; soft ones have opacities of their own."""
        b, shapes = self.buffers, self._parameters.shape_count
        self._launch(program, plan.plan_grid, shapes, scale=self._plan_scale)
        ranges = (b.gaussian_count, b.gaussian_ends, b.gaussian_range)
        record_ranges(program, *ranges, self._needed, capacity=self._capacity)
        for kernels in self._kernels:
            self._launch(program, kernels.forward, self._capacity)
        kernel = soft.soft_gaussians_forward if self.softness else gaussians.gaussians_forward
        self._launch(program, kernel, self._capacity)

    def backward(self, program: Program) -> None:
        """Record gradients of means, conics and strengths -> gradients of the shapes' attributes."""
        kernel = soft.soft_differences_backward if self.softness else gaussians.differences_backward
        self._launch(program, kernel, self._capacity)
        self._launch(program, gaussians.positions_backward, self._capacity)
        for kernels in self._kernels:
            if kernels.stations_backward:
                self._launch(program, kernels.stations_backward, self._capacity)
            self._launch(program, kernels.points_backward, self._parameters.point_count)
        if self.softness:
            self._launch(program, soft.soft_shapes_backward, self._parameters.shape_count)
