"""The splat renderer: curves as Gaussians (the paper's model)."""

from __future__ import annotations

import warp as wp

from warpsplat.kernels import gaussian, sample, splat
from warpsplat.launch import Program
from warpsplat.parameters import Parameters
from warpsplat.render import Capacity, TileRenderer


class SplatRenderer(TileRenderer):
    """Coverage from Gaussians on a grid along and across each curve.

    ``through_scales``: whether gradients flow through the Gaussians' scales and angles. ``fold``: weight of
    the fold loss (closed curves; the folded fraction of the canvas), which ``backward`` adds.
    """

    items_per_part = 64
    product = 1

    def __init__(
        self,
        parameters: Parameters,
        width: int,
        height: int,
        scale: float,
        *,
        threads: int | None = None,
        capacity: Capacity | None = None,
        through_scales: bool = True,
        fold: float = 0.0,
    ) -> None:
        self.through_scales, self.fold = through_scales, fold
        super().__init__(parameters, width, height, scale, threads=threads, capacity=capacity)

    def _allocate_items(self) -> None:
        parts, gaussians, vectors = self.parameters.part_count, self.capacity.items, self.vectors
        self.part_columns, self.part_rows = self.ints(parts), self.ints(parts)
        self.part_reach, self.part_sign = self.floats(parts), self.floats(parts)
        self.gaussian_part, self.gaussian_across = self.ints(gaussians), self.floats(gaussians)
        self.mean = vectors(wp.vec2, gaussians)
        self.conic, self.extent = vectors(wp.vec3, gaussians), vectors(wp.vec2, gaussians)
        self.cut = self.floats(gaussians)
        self.mean_grad, self.conic_grad = vectors(wp.vec2, gaussians), vectors(wp.vec3, gaussians)
        self.along_grad, self.across_grad = vectors(wp.vec2, gaussians), vectors(wp.vec2, gaussians)
        self.position_grad, self.column_grad = vectors(wp.vec2, gaussians), vectors(wp.vec2, gaussians)
        self.column_width_grad = self.floats(gaussians)

    def _grid_inputs(self) -> list[object]:
        p = self.parameters
        # Each cubic of a stroke is a strip of its own.
        runs = (p.point_count - 1) // (3 * p.opacity_count) if p.kind == "open" else 1
        return [self.gaussian_part, self.part_first, self.part_columns, self.part_rows, runs]

    def _record_items(self, program: Program) -> tuple[wp.array, wp.array]:
        p, gaussians = self.parameters, self.capacity.items
        plan = [self.part_columns, self.part_rows, self.part_reach]
        if p.kind == "closed":
            outputs = [*plan, self.part_items, self.part_sign]
            program.add(sample.plan_closed, p.part_count, [p.points, self.scale], outputs, split=True)
        else:
            inputs = [p.points, p.widths, p.opacity_count, self.scale]
            program.add(sample.plan_open, p.part_count, inputs, [*plan, self.part_items], split=True)
        self._record_ranges(program)
        ranges = [self.part_ends, self.part_first, self.part_last, *plan]
        grid = [self.gaussian_part, self.gaussian_across, self.mean]
        if p.kind == "closed":
            inputs = [p.points, self.scale, *ranges]
            program.add(sample.points_closed_forward, gaussians, inputs, grid, split=True)
        else:
            inputs = [p.points, p.widths, p.opacity_count, self.scale, *ranges]
            program.add(sample.points_open_forward, gaussians, inputs, grid, split=True)
        program.add(
            gaussian.gaussians_forward,
            gaussians,
            [*self._grid_inputs(), self.mean],
            [self.conic, self.extent, self.cut],
            split=True,
        )
        return self.mean, self.extent

    def _record_coverage(self, program: Program) -> None:
        program.add(
            splat.splat_forward,
            (self.capacity.slots, self.lanes),
            [self.lanes, self.slot_part, self.slot_first, self.part_tiles]
            + [self.part_first, self.part_last, self.mean, self.conic, self.extent, self.cut],
            [self.coverage_columns, self.slot_state],
            split=True,
        )
        self._record_lists(program)

    def _record_coverage_backward(self, program: Program) -> None:
        p, gaussians = self.parameters, self.capacity.items
        grid = self._grid_inputs()
        program.add(
            splat.splat_backward,
            gaussians,
            [self.gaussian_part, self.slot_first, self.slot_last, self.slot_state, self.part_tiles]
            + [self.mean, self.conic, self.extent, self.cut, self.coverage_columns],
            [self.mean_grad, self.conic_grad],
            split=True,
        )
        program.add(
            gaussian.differences_backward,
            gaussians,
            [*grid, self.mean, self.conic_grad, float(self.through_scales), self.part_sign]
            + [self.fold / (self.width * self.height)],
            [self.along_grad, self.across_grad],
            split=True,
        )
        program.add(
            gaussian.positions_backward,
            gaussians,
            [*grid, self.mean_grad, self.along_grad, self.across_grad],
            [self.position_grad],
            split=True,
        )
        columns = [self.gaussian_part, self.gaussian_across, *grid[1:-1], self.position_grad]
        if p.kind == "closed":
            inputs = [self.scale, *columns]
            program.add(sample.columns_closed_backward, gaussians, inputs, [self.column_grad], split=True)
            program.add(
                sample.points_closed_backward,
                (p.curve_count, p.point_count),
                [self.part_first, self.part_last, self.part_columns, self.column_grad],
                [p.points_grad],
                split=True,
            )
        else:
            program.add(
                sample.columns_open_backward,
                gaussians,
                [p.points, p.widths, p.opacity_count, self.scale, *columns],
                [self.column_grad, self.column_width_grad],
                split=True,
            )
            program.add(
                sample.points_open_backward,
                (p.curve_count, p.point_count),
                [p.widths, p.opacity_count, self.scale, self.part_first, self.part_last]
                + [self.part_columns, self.part_rows, self.column_grad, self.column_width_grad],
                [p.points_grad, p.widths_grad],
                split=True,
            )
