"""The grid stage: shapes -> Gaussians (the paper's model), and the adjoint."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warpsplat.paper.chains import check_chains
from warpsplat.paper.kernels import fill, gaussians, stroke
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.program import Program
from warpsplat.rendering.ranges import record_ranges
from warpsplat.scene import Kind


@dataclass
class GridBuffers:
    """Buffers of the stage."""

    shape_stations: wp.array = buffer(wp.int32, "shapes")
    """Gaussians along each shape."""
    shape_runs: wp.array = buffer(wp.int32, "shapes")
    """Stretches of stations without neighbours in one another."""
    shape_rows: wp.array = buffer(wp.int32, "shapes")
    """Gaussians across each shape."""
    shape_reach: wp.array = buffer(wp.float32, "shapes")
    shape_sign: wp.array = buffer(wp.float32, "shapes")
    """Orientation of a fill's outline."""
    gaussian_count: wp.array = buffer(wp.int32, "shapes")
    gaussian_ends: wp.array = buffer(wp.int32, "shapes")
    gaussian_first: wp.array = buffer(wp.int32, "shapes")
    gaussian_last: wp.array = buffer(wp.int32, "shapes")
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
    strength: wp.array = buffer(wp.float32, 0)
    """Opacity of each Gaussian; ``SoftBuffers`` alone has any."""
    strength_grad: wp.array = buffer(wp.float32, 0)


@dataclass(frozen=True)
class GridKernels:
    """Kernels that put one kind of shape on a grid, and their adjoints."""

    plan: wp.Kernel
    forward: wp.Kernel
    stations_backward: wp.Kernel
    points_backward: wp.Kernel


GRIDS = {
    Kind.FILL: GridKernels(
        fill.plan_fill, fill.fill_grid_forward, fill.fill_stations_backward, fill.fill_points_backward
    ),
    Kind.STROKE: GridKernels(
        stroke.plan_stroke,
        stroke.stroke_grid_forward,
        stroke.stroke_stations_backward,
        stroke.stroke_points_backward,
    ),
}


class Grid:
    """Puts a grid of Gaussians along and across each shape."""

    owned: type[GridBuffers] = GridBuffers
    """Class of its buffers."""

    def __init__(self, inputs: StageInputs, *, through_scales: bool, fold: float) -> None:
        """Allocate.

        Raises:
            ValueError: a fill has an odd number of cubics, and so no two chains (paper section 3.2).
        """
        self._parameters, self._viewport = inputs.parameters, inputs.viewport
        self._through_scales, self._fold = through_scales, fold
        self._capacity, self._needed = inputs.samples, inputs.needed
        check_chains(inputs.parameters.structure)
        sizes = {"shapes": inputs.parameters.shape_count, "gaussians": inputs.samples}
        self.buffers = inputs.backend.allocate(self.owned, sizes)

    def samples(self) -> dict[str, wp.array]:
        """Return the parameters of ``bins.rectangles``."""
        b = self.buffers
        return {
            "sample_first": b.gaussian_first,
            "sample_last": b.gaussian_last,
            "position": b.mean,
            "extent": b.extent,
        }

    @property
    def _sources(self) -> tuple[object, ...]:
        return self.buffers, self._parameters.arrays, self._viewport

    def _number(self, program: Program) -> None:
        """Record counts of Gaussians -> where those of each shape are."""
        b = self.buffers
        ranges = (b.gaussian_count, b.gaussian_ends, b.gaussian_first, b.gaussian_last)
        record_ranges(program, *ranges, self._needed, capacity=self._capacity)

    def forward(self, program: Program) -> None:
        """Record points, widths -> Gaussians."""
        b, p = self.buffers, self._parameters
        for kind in sorted(p.kinds):
            program.launch(GRIDS[kind].plan, p.shape_count, *self._sources, split=True)
        self._number(program)
        for kind in sorted(p.kinds):
            program.launch(GRIDS[kind].forward, self._capacity, *self._sources, split=True)
        program.launch(gaussians.gaussians_forward, self._capacity, b, split=True)

    def backward(self, program: Program) -> None:
        """Record gradients of means and conics -> gradients of points and widths."""
        b, p = self.buffers, self._parameters
        program.launch(
            gaussians.differences_backward,
            self._capacity,
            b,
            through_scales=float(self._through_scales),
            fold_factor=self._fold / self._viewport.pixel_count,
            split=True,
        )
        program.launch(gaussians.positions_backward, self._capacity, b, split=True)
        for kind in sorted(p.kinds):
            program.launch(GRIDS[kind].stations_backward, self._capacity, *self._sources, split=True)
            program.launch(GRIDS[kind].points_backward, p.point_count, *self._sources, split=True)
