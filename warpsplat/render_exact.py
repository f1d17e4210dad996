"""The exact renderer: the coverage that a viewer computes for the exported paths."""

from __future__ import annotations

import warp as wp

from warpsplat.kernels import constants, fill, flatten, stroke
from warpsplat.launch import Program
from warpsplat.render import TileRenderer


class ExactRenderer(TileRenderer):
    """Fills by signed area, strokes by distance, both of flattened curves."""

    items_per_part = 48

    product = 0

    def _allocate_items(self) -> None:
        parts, vertices = self.parameters.part_count, self.capacity.items
        cubics = self.parameters.point_count // 3 // self.parameters.opacity_count
        self.cubic_first = self.ints(parts, cubics + 1)
        self.vertex_part = self.ints(vertices)
        self.vertex, self.extent = self.vectors(wp.vec2, vertices), self.vectors(wp.vec2, vertices)
        self.start_grad, self.end_grad = self.vectors(wp.vec2, vertices), self.vectors(wp.vec2, vertices)
        if self._closed:
            self.slot_winding = self.ints(self.capacity.slots)
        else:
            self.slot_near = self.ints(self.capacity.slots, self.lanes)
            self.segment = self.ints(self.capacity.slots, constants.TILE_PIXELS)
            self.half_grad = self.floats(vertices)

    @property
    def _closed(self) -> int:
        return int(self.parameters.kind == "closed")

    def _record_items(self, program: Program) -> tuple[wp.array, wp.array]:
        p = self.parameters
        program.add(
            flatten.plan_flatten,
            p.part_count,
            [p.points, self._closed, p.opacity_count, self.scale],
            [self.cubic_first, self.part_items],
        )
        self._record_ranges(program)
        program.add(
            flatten.flatten_forward,
            (p.part_count, self.cubic_first.shape[1] - 1),
            [p.points, p.widths, self._closed, p.opacity_count, self.scale]
            + [self.part_first, self.part_last, self.cubic_first],
            [self.vertex_part, self.vertex, self.extent],
            split=True,
        )
        return self.vertex, self.extent

    def _record_coverage(self, program: Program) -> None:
        p = self.parameters
        shape = (self.capacity.slots, self.lanes)
        if self._closed:
            rows = [self.slot_part, self.slot_first]
            outline = [self.part_tiles, self.part_first, self.part_last, self.vertex]
            states = [self.slot_state, self.slot_winding]
            program.add(fill.fill_states, self.capacity.slots, [*rows, *outline], states, split=True)
            self._record_lists(program)
            program.add(
                fill.fill_forward,
                shape,
                [self.lane_size, *rows, *states, *outline],
                [self.coverage, self.coverage_columns],
                split=True,
            )
        else:
            program.add(
                stroke.stroke_forward,
                shape,
                [self.lane_size, self.slot_part, self.slot_first, p.opacity_count, p.widths, self.scale]
                + [self.part_tiles, self.part_first, self.part_last, self.vertex],
                [self.coverage, self.coverage_columns, self.segment, self.slot_state, self.slot_near],
                split=True,
            )
            self._record_lists(program)

    def _record_coverage_backward(self, program: Program) -> None:
        p, vertices = self.parameters, self.capacity.items
        slots = [self.slot_first, self.slot_last, self.slot_state, self.part_tiles, self.vertex]
        if self._closed:
            program.add(
                fill.fill_backward,
                vertices,
                [self.width, self.height, self.vertex_part, self.part_ends]
                + [self.part_first, self.part_last, *slots, self.coverage],
                [self.start_grad, self.end_grad],
                split=True,
            )
        else:
            program.add(
                stroke.stroke_backward,
                vertices,
                [self.width, self.height, p.opacity_count, p.widths, self.scale]
                + [self.vertex_part, self.part_ends]
                + [self.part_first, self.part_last, *slots, self.segment, self.coverage],
                [self.start_grad, self.end_grad, self.half_grad],
                split=True,
            )
            program.add(
                stroke.widths_backward,
                p.curve_count,
                [p.opacity_count, self.scale, self.part_first, self.part_last, self.half_grad],
                [p.widths_grad],
            )
        program.add(
            flatten.flatten_backward,
            (p.curve_count, p.point_count),
            [self._closed, p.opacity_count, self.scale, self.part_first, self.part_last, self.cubic_first]
            + [self.start_grad, self.end_grad],
            [p.points_grad],
            split=True,
        )
