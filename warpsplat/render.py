"""The splat renderer: arrays of fixed capacity and the launches that fill them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsplat.errors import CapacityError
from warpsplat.kernels import bin as binning
from warpsplat.kernels import composite, constants, gaussian, sample, splat
from warpsplat.launch import Program
from warpsplat.parameters import Parameters
from warpsplat.scene import OPEN_SEGMENTS, FloatArray, Scene

TILE = constants.TILE
GROWTH = 1.5
"""Capacity over need when an array has to grow, so that a growing scene seldom does."""
SLOT_LIMIT = 2_000_000
"""Most slots (2 KiB each) before a scene is refused: 4 GiB."""
GAUSSIAN_LIMIT = 16_000_000
"""Most Gaussians (about 120 bytes each) before a scene is refused."""


@dataclass(frozen=True)
class Capacity:
    """Sizes of the arrays whose need depends on the scene."""

    gaussians: int
    slots: int


class SplatRenderer:
    """Renders ``parameters`` at ``width`` x ``height`` px, ``scale`` px per canvas unit; and the adjoint.

    ``through_scales``: whether gradients flow through the Gaussians' scales and angles. ``fold``: weight of
    the fold loss (closed curves; the folded fraction of the canvas), which ``backward`` adds.
    Nothing is allocated and nothing is copied to the host between ``forward`` and ``backward``. A scene
    that needs more than the capacity is rendered without the parts that do not fit; ``grow`` reports it.
    """

    def __init__(
        self,
        parameters: Parameters,
        width: int,
        height: int,
        scale: float,
        *,
        threads: int | None = None,
        through_scales: bool = True,
        fold: float = 0.0,
        capacity: Capacity | None = None,
    ) -> None:
        self.parameters = parameters
        self.width, self.height, self.scale = width, height, scale
        self.device = parameters.device
        self.through_scales, self.fold = through_scales, fold
        self._threads = threads
        self.tiles_x = -(-width // TILE)
        self.tiles_y = -(-height // TILE)
        # A GPU gives each pixel row of a tile a thread; a CPU keeps a tile in one thread's cache.
        self.lanes = 1 if self.device.is_cpu else TILE
        self.image = wp.zeros((height, width), dtype=wp.vec3, device=self.device)
        self.image_grad = wp.zeros((height, width), dtype=wp.vec3, device=self.device)
        self.transmittance = wp.zeros((height, width), dtype=wp.float32, device=self.device)
        self.behind = wp.zeros((height, width), dtype=wp.float32, device=self.device)
        self.needed_gaussians = wp.zeros(1, dtype=wp.int32, device=self.device)
        self.needed_slots = wp.zeros(1, dtype=wp.int32, device=self.device)
        self.forward_program: Program | None = None
        self.backward_program: Program | None = None
        tiles = self.tiles_x * self.tiles_y
        self.capacity = capacity or Capacity(64 * parameters.part_count, tiles + 8 * parameters.part_count)
        self.rebuild()

    def rebuild(self) -> None:
        """Allocate the arrays for the current capacity and record the launches."""
        self.close()
        self._allocate()
        self.forward_program = self._record_forward()
        self.backward_program = self._record_backward()

    def close(self) -> None:
        """End the threads of the recorded launches."""
        for program in (self.forward_program, self.backward_program):
            if program:
                program.close()

    def _allocate(self) -> None:
        def ints(*shape: int) -> wp.array:
            return wp.zeros(shape, dtype=wp.int32, device=self.device)

        def floats(*shape: int) -> wp.array:
            return wp.zeros(shape, dtype=wp.float32, device=self.device)

        def vectors(dtype: type, count: int) -> wp.array:
            return wp.zeros(count, dtype=dtype, device=self.device)

        parts, gaussians, slots = self.parameters.part_count, self.capacity.gaussians, self.capacity.slots
        tiles = self.tiles_x * self.tiles_y
        self.part_columns, self.part_rows, self.part_gaussians = ints(parts), ints(parts), ints(parts)
        self.part_reach, self.part_sign = floats(parts), floats(parts)
        self.part_ends, self.part_first, self.part_last = ints(parts), ints(parts), ints(parts)
        self.part_tiles = ints(parts, 4)
        self.front_slots, self.front_ends = ints(parts), ints(parts)
        self.slot_first, self.slot_last = ints(parts), ints(parts)
        self.gaussian_part, self.gaussian_across = ints(gaussians), floats(gaussians)
        self.mean, self.gaussian_scale = vectors(wp.vec2, gaussians), vectors(wp.vec2, gaussians)
        self.gaussian_angle = floats(gaussians)
        self.conic, self.extent = vectors(wp.vec3, gaussians), vectors(wp.vec2, gaussians)
        self.mean_grad, self.conic_grad = vectors(wp.vec2, gaussians), vectors(wp.vec3, gaussians)
        self.along_grad, self.across_grad = vectors(wp.vec2, gaussians), vectors(wp.vec2, gaussians)
        self.position_grad, self.column_grad = vectors(wp.vec2, gaussians), vectors(wp.vec2, gaussians)
        self.column_width_grad = floats(gaussians)
        self.slot_part, self.slot_tile = ints(slots), ints(slots)
        self.sort_keys, self.sort_slots = ints(2 * slots), ints(2 * slots)
        self.tile_first, self.tile_last = ints(tiles), ints(tiles)
        self.coverage = floats(slots, constants.TILE_PIXELS)
        self.coverage_grad = floats(slots, constants.TILE_PIXELS)
        self.slot_seen = ints(slots, self.lanes)
        self.slot_grad = wp.zeros((slots, self.lanes), dtype=wp.vec4, device=self.device)

    def _record_forward(self) -> Program:
        p = self.parameters
        program = Program(self.device, self._threads)
        gaussians, slots, parts = self.capacity.gaussians, self.capacity.slots, p.part_count
        tiles = self.tiles_x * self.tiles_y
        plan = [self.part_columns, self.part_rows, self.part_reach]
        ranges = [self.part_ends, self.part_first, self.part_last, *plan]
        if p.kind == "closed":
            program.add(
                sample.plan_closed,
                parts,
                [p.points, self.scale],
                [*plan, self.part_gaussians, self.part_sign],
            )
        else:
            program.add(
                sample.plan_open,
                parts,
                [p.points, p.widths, p.opacity_count, self.scale],
                [*plan, self.part_gaussians],
            )
        program.call(wp.utils.array_scan, self.part_gaussians, self.part_ends, True)
        program.add(
            sample.clip_ranges,
            parts,
            [self.part_gaussians, self.part_ends, gaussians, 0],
            [self.part_first, self.part_last, self.needed_gaussians],
        )
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
            [self.gaussian_scale, self.gaussian_angle, self.conic, self.extent],
            split=True,
        )
        program.add(
            binning.part_rectangles,
            parts,
            [self.part_first, self.part_last, self.mean, self.extent, self.tiles_x, self.tiles_y],
            [self.part_tiles, self.front_slots],
        )
        program.call(wp.utils.array_scan, self.front_slots, self.front_ends, True)
        program.add(
            sample.clip_ranges,
            parts,
            [self.front_slots, self.front_ends, slots, 1],
            [self.slot_first, self.slot_last, self.needed_slots],
        )
        program.add(
            binning.fill_slots,
            slots,
            [self.front_ends, self.slot_first, self.slot_last, self.part_tiles, self.tiles_x],
            [self.slot_part, self.slot_tile, self.sort_keys, self.sort_slots],
        )
        program.call(wp.utils.radix_sort_pairs, self.sort_keys, self.sort_slots, slots)
        program.add(binning.clear_ranges, tiles, [], [self.tile_first, self.tile_last])
        program.add(binning.tile_ranges, slots, [self.sort_keys, slots], [self.tile_first, self.tile_last])
        lane_rows = TILE // self.lanes
        program.add(
            splat.splat_forward,
            (slots, self.lanes),
            [lane_rows, self.slot_part, self.slot_tile, self.tiles_x]
            + [self.part_first, self.part_last, self.mean, self.conic, self.extent],
            [self.coverage, self.slot_seen],
            split=True,
        )
        program.add(
            composite.composite_forward,
            (tiles, self.lanes),
            [*self._composite_inputs(), wp.vec3(*(float(x) for x in p.background))],
            [self.image, self.transmittance],
            split=True,
        )
        return program

    def _grid_inputs(self) -> list[object]:
        runs = OPEN_SEGMENTS // self.parameters.opacity_count if self.parameters.kind == "open" else 1
        return [self.gaussian_part, self.part_first, self.part_columns, self.part_rows, runs]

    def _composite_inputs(self) -> list[object]:
        p = self.parameters
        lists = [self.tile_first, self.tile_last, self.sort_slots, self.slot_part, self.slot_seen]
        return [
            TILE // self.lanes, self.tiles_x, *lists, self.coverage, p.opacity_count, p.colors, p.opacities,
        ]  # fmt: skip

    def _record_backward(self) -> Program:
        p = self.parameters
        program = Program(self.device, self._threads)
        gaussians = self.capacity.gaussians
        grid = self._grid_inputs()
        program.add(
            composite.composite_backward,
            (self.tiles_x * self.tiles_y, self.lanes),
            [*self._composite_inputs(), self.image, self.image_grad],
            [self.transmittance, self.behind, self.coverage_grad, self.slot_grad],
            split=True,
        )
        program.add(
            composite.reduce_slots,
            p.curve_count,
            [p.opacity_count, self.slot_first, self.slot_last, self.slot_grad],
            [p.colors_grad, p.opacities_grad],
        )
        program.add(
            splat.splat_backward,
            gaussians,
            [self.width, self.height, self.gaussian_part, self.slot_first, self.slot_last, self.part_tiles]
            + [self.mean, self.conic, self.extent, self.coverage, self.coverage_grad],
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
            program.add(
                sample.columns_closed_backward,
                gaussians,
                [self.scale, *columns],
                [self.column_grad],
                split=True,
            )
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
        return program

    def forward(self) -> None:
        """Render into ``image``."""
        assert self.forward_program
        self.forward_program.run()

    def backward(self) -> None:
        """From ``image_grad`` and the last forward pass to the gradients of the parameters."""
        assert self.backward_program
        self.backward_program.run()

    def grow(self) -> bool:
        """Whether the passes since the last call ran out of capacity; if so, the arrays are now larger.

        Reads two counters back from the device.

        Raises:
            CapacityError: the scene needs more than SLOT_LIMIT or GAUSSIAN_LIMIT.
        """
        gaussians = int(self.needed_gaussians.numpy()[0])
        slots = int(self.needed_slots.numpy()[0])
        if gaussians > GAUSSIAN_LIMIT or slots > SLOT_LIMIT:
            raise CapacityError(
                f"the scene needs {gaussians} Gaussians and {slots} tile slots, more than the limits of "
                f"{GAUSSIAN_LIMIT} and {SLOT_LIMIT}: fewer curves or a smaller image are needed"
            )
        if gaussians <= self.capacity.gaussians and slots <= self.capacity.slots:
            return False
        self.capacity = Capacity(
            max(self.capacity.gaussians, int(GROWTH * gaussians)),
            max(self.capacity.slots, int(GROWTH * slots)),
        )
        self.needed_gaussians.zero_()
        self.needed_slots.zero_()
        self.rebuild()
        return True

    def forward_complete(self) -> None:
        """Render, growing until everything fits."""
        self.forward()
        while self.grow():
            self.forward()


def render(
    scene: Scene,
    *,
    scale: float = 1.0,
    device: wp.Device | str | None = None,
    threads: int | None = None,
) -> FloatArray:
    """Render ``scene`` with splats at ``scale`` px per canvas unit.

    Samples follow the size in pixels, so a scene can be rendered at any size (paper section 3.3).

    Returns:
        sRGB in [0, 1], shape (height, width, 3).
    """
    target = wp.get_device(device)
    width, height = max(1, round(scene.width * scale)), max(1, round(scene.height * scale))
    renderer = SplatRenderer(Parameters(scene, target), width, height, scale, threads=threads)
    try:
        renderer.forward_complete()
        return np.asarray(renderer.image.numpy(), np.float32)
    finally:
        renderer.close()


__all__ = ["Capacity", "SplatRenderer", "render"]
