"""Renderers: arrays of fixed capacity and the launches that fill them.

``TileRenderer`` holds what every model of coverage shares: slots, tile lists, compositing, capacities. A
subclass turns curves into items with positions (Gaussians, vertices) and items into coverage.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsplat.errors import CapacityError
from warpsplat.kernels import bin as binning
from warpsplat.kernels import composite, constants, sample
from warpsplat.kernels.tile import column
from warpsplat.launch import Program
from warpsplat.parameters import Parameters, view
from warpsplat.scene import FloatArray, Scene
from warpsplat.tiles import from_tiles, tile_counts, to_tiles

TILE = constants.TILE
GROWTH = 1.5
"""Capacity over need when an array has to grow, so that a growing scene seldom does."""
SLOT_LIMIT = 1_500_000
"""Most slots (1.3 KiB each, 2.4 for strokes) before a scene is refused: up to 3.5 GiB."""
ITEM_LIMIT = 16_000_000
"""Most Gaussians or vertices (about 120 bytes each) before a scene is refused."""


def lanes_on(device: wp.Device) -> int:
    """Threads a tile: a GPU gives each row or column one; a CPU keeps a tile in one thread's cache."""
    return 1 if device.is_cpu else TILE


@dataclass(frozen=True)
class Capacity:
    """Sizes of the arrays whose need depends on the scene."""

    items: int
    slots: int


class TileRenderer(ABC):
    """Renders ``parameters`` at ``width`` x ``height`` px, ``scale`` px per canvas unit; and the adjoint.

    Nothing is allocated and nothing is copied to the host between ``forward`` and ``backward``. A scene
    that needs more than the capacity is rendered without the parts that do not fit; ``grow`` reports it.
    """

    items_per_part: int
    """First guess of the need."""

    product: int
    """1 where a coverage is 1 - exp(-s), 0 where it is |s|, clamped at 1."""

    def __init__(
        self,
        parameters: Parameters,
        width: int,
        height: int,
        scale: float,
        *,
        threads: int | None = None,
        capacity: Capacity | None = None,
    ) -> None:
        self.parameters = parameters
        self.width, self.height, self.scale = width, height, scale
        self.device = parameters.device
        self._threads = threads
        self.tiles_x, self.tiles_y = tile_counts(width, height)
        self.lanes = lanes_on(self.device)
        self.lane_size = TILE // self.lanes
        tiles = self.tiles_x * self.tiles_y
        self.image = self.columns(tiles, 3, TILE)
        self.image_grad = self.columns(tiles, 3, TILE)
        self.inside = self.columns(tiles, TILE)
        self.inside.assign(to_tiles(np.ones((height, width, 1), np.float32))[:, 0])
        self.needed_items = wp.zeros(1, dtype=wp.int32, device=self.device)
        self.needed_slots = wp.zeros(1, dtype=wp.int32, device=self.device)
        self.forward_program: Program | None = None
        self.backward_program: Program | None = None
        first_guess = Capacity(self.items_per_part * parameters.part_count, tiles + 8 * parameters.part_count)
        self.capacity = capacity or first_guess
        self.rebuild()

    def rebuild(self) -> None:
        """Allocate the arrays for the current capacity and record the launches."""
        self._allocate()
        self._allocate_items()
        self.forward_program = self._record_forward()
        self.backward_program = self._record_backward()

    def ints(self, *shape: int) -> wp.array:
        """A zeroed int32 array."""
        return wp.zeros(shape, dtype=wp.int32, device=self.device)

    def floats(self, *shape: int) -> wp.array:
        """A zeroed float32 array."""
        return wp.zeros(shape, dtype=wp.float32, device=self.device)

    def vectors(self, dtype: type, count: int) -> wp.array:
        """A zeroed array of vectors."""
        return wp.zeros(count, dtype=dtype, device=self.device)

    def _allocate(self) -> None:
        parts, slots = self.parameters.part_count, self.capacity.slots
        tiles = self.tiles_x * self.tiles_y
        self.part_items = self.ints(parts)
        self.part_ends, self.part_first, self.part_last = self.ints(parts), self.ints(parts), self.ints(parts)
        self.part_tiles = self.ints(parts, 4)
        self.front_slots, self.front_ends = self.ints(parts), self.ints(parts)
        self.slot_first, self.slot_last = self.ints(parts), self.ints(parts)
        self.slot_part, self.slot_tile = self.ints(slots), self.ints(slots)
        self.sort_keys, self.sort_slots = self.ints(2 * slots), self.ints(2 * slots)
        self.tile_first, self.tile_last = self.ints(tiles), self.ints(tiles)
        self.slot_state = self.ints(slots)
        self.tile_stop, self.list_slot = self.ints(tiles), self.ints(slots)
        self.list_paint = self.vectors(wp.vec4, slots)
        # A tile of floats for each slot, as pixels and, in the same memory, as columns.
        self.coverage = self.floats(slots, constants.TILE_PIXELS)
        self.coverage_columns = view(self.coverage, column, (slots, TILE))
        # Sums over a tile: columns where a thread has the tile, else one number a lane.
        self.slot_columns = self.columns(slots if self.lanes == 1 else 1, 4)
        self.slot_grad = wp.zeros(
            (1 if self.lanes == 1 else slots, self.lanes), dtype=wp.vec4, device=self.device
        )

    def columns(self, *shape: int) -> wp.array:
        """A zeroed array of columns of a tile."""
        return wp.zeros(shape, dtype=column, device=self.device)

    @abstractmethod
    def _allocate_items(self) -> None:
        """Allocate what the subclass needs."""

    @abstractmethod
    def _record_items(self, program: Program) -> tuple[wp.array, wp.array]:
        """Curves -> items; returns (position, extent) of each, for their tiles."""

    @abstractmethod
    def _record_coverage(self, program: Program) -> None:
        """Items -> ``slot_state``, the lists of visible slots (``_record_lists``) and ``coverage``."""

    @abstractmethod
    def _record_coverage_backward(self, program: Program) -> None:
        """The gradient of s, now in ``coverage`` -> gradients of points and widths."""

    def _record_ranges(self, program: Program) -> None:
        """``part_items`` -> ``part_first``, ``part_last``."""
        program.call(wp.utils.array_scan, self.part_items, self.part_ends, True)
        program.add(
            sample.clip_ranges,
            self.parameters.part_count,
            [self.part_items, self.part_ends, self.capacity.items, 0],
            [self.part_first, self.part_last, self.needed_items],
        )

    def _record_forward(self) -> Program:
        program = Program(self.device, self._threads)
        program.stage = "sample"
        position, extent = self._record_items(program)
        program.stage = "bin"
        self._record_bins(program, position, extent)
        program.stage = "forward"
        self._record_coverage(program)
        program.add(
            composite.composite_forward,
            (self.tiles_x * self.tiles_y, self.lanes),
            [*self._composite_inputs(), wp.vec3(*(float(x) for x in self.parameters.background))],
            [self.image],
            split=True,
        )
        return program

    def _record_bins(self, program: Program, position: wp.array, extent: wp.array) -> None:
        """Items -> slots, and each tile's list of them."""
        slots, parts = self.capacity.slots, self.parameters.part_count
        tiles = self.tiles_x * self.tiles_y
        program.add(
            binning.part_rectangles,
            parts,
            [self.part_first, self.part_last, position, extent, self.tiles_x, self.tiles_y],
            [self.part_tiles, self.front_slots],
            split=True,
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
            [self.slot_part, self.slot_tile, self.slot_state, self.sort_keys, self.sort_slots],
            split=True,
        )
        program.call(wp.utils.radix_sort_pairs, self.sort_keys, self.sort_slots, slots)
        program.add(binning.clear_ranges, tiles, [], [self.tile_first, self.tile_last])
        program.add(binning.tile_ranges, slots, [self.sort_keys, slots], [self.tile_first, self.tile_last])

    def _record_lists(self, program: Program) -> None:
        """``slot_state`` -> each tile's list of visible slots."""
        p = self.parameters
        program.add(
            binning.list_visible,
            self.tiles_x * self.tiles_y,
            [self.sort_slots, self.slot_part, p.opacity_count, p.colors, p.opacities]
            + [self.tile_first, self.tile_last],
            [self.slot_state, self.tile_stop, self.list_slot, self.list_paint],
            split=True,
        )

    def _composite_inputs(self) -> list[object]:
        lists = [self.tile_first, self.tile_stop, self.list_slot, self.list_paint]
        return [self.lane_size, *lists, self.coverage_columns]

    def _record_backward(self) -> Program:
        p = self.parameters
        program = Program(self.device, self._threads)
        program.stage = "backward"
        program.add(
            composite.composite_backward,
            (self.tiles_x * self.tiles_y, self.lanes),
            [*self._composite_inputs(), self.product, self.image, self.image_grad],
            [self.coverage_columns, self.slot_columns, self.slot_grad],
            split=True,
        )
        program.add(
            composite.reduce_slots,
            p.curve_count,
            [p.opacity_count, self.lanes, self.slot_first, self.slot_last, self.slot_state]
            + [self.slot_columns, self.slot_grad],
            [p.colors_grad, p.opacities_grad],
            split=True,
        )
        self._record_coverage_backward(program)
        return program

    def forward(self) -> None:
        """Render into ``image``."""
        assert self.forward_program
        self.forward_program.run()

    def backward(self) -> None:
        """From ``image_grad`` and the last forward pass to the gradients of the parameters."""
        assert self.backward_program
        self.backward_program.run()

    def read_image(self) -> FloatArray:
        """``image`` on the host: sRGB in [0, 1], shape (height, width, 3)."""
        return from_tiles(self.image.numpy(), self.width, self.height)

    def write_image_grad(self, gradient: FloatArray) -> None:
        """Set ``image_grad`` from the host, shape (height, width, 3)."""
        self.image_grad.assign(to_tiles(gradient))

    def removal_costs(self, target: wp.array) -> FloatArray:
        """What the mean squared error against ``target`` would grow by without each curve, after ``forward``.

        ``target``: tiles as ``image``. Shape of the result: (curve,); for an opacity per segment, the sum.
        Allocates and copies to the host: for use between steps.
        """
        cost = self.floats(self.capacity.slots, self.lanes)
        program = Program(self.device, self._threads)
        program.add(
            composite.removal_cost,
            (self.tiles_x * self.tiles_y, self.lanes),
            [*self._composite_inputs(), self.image, target, self.inside],
            [cost],
            split=True,
        )
        program.run()
        parts = self.slot_part.numpy()
        used = parts >= 0
        totals = np.bincount(
            parts[used] // self.parameters.opacity_count,
            weights=cost.numpy().sum(axis=1, dtype=np.float64)[used],
            minlength=self.parameters.curve_count,
        )
        return np.asarray(totals / (3 * self.width * self.height), np.float32)

    def grow(self) -> bool:
        """Whether the passes since the last call ran out of capacity; if so, the arrays are now larger.

        Reads two counters back from the device.

        Raises:
            CapacityError: the scene needs more than SLOT_LIMIT or ITEM_LIMIT.
        """
        items = int(self.needed_items.numpy()[0])
        slots = int(self.needed_slots.numpy()[0])
        if items > ITEM_LIMIT or slots > SLOT_LIMIT:
            raise CapacityError(
                f"the scene needs {items} samples and {slots} tile slots, more than the limits of "
                f"{ITEM_LIMIT} and {SLOT_LIMIT}: fewer curves or a smaller image are needed"
            )
        if items <= self.capacity.items and slots <= self.capacity.slots:
            return False
        self.capacity = Capacity(
            max(self.capacity.items, int(GROWTH * items)), max(self.capacity.slots, int(GROWTH * slots))
        )
        self.needed_items.zero_()
        self.needed_slots.zero_()
        self.rebuild()
        return True

    def forward_complete(self) -> bool:
        """Render, growing until everything fits; whether it had to grow, and so has other arrays now."""
        self.forward()
        grown = False
        while self.grow():
            grown = True
            self.forward()
        return grown


def make_renderer(
    name: str,
    parameters: Parameters,
    width: int,
    height: int,
    scale: float,
    *,
    threads: int | None = None,
    capacity: Capacity | None = None,
    through_scales: bool = True,
    fold: float = 0.0,
) -> TileRenderer:
    """``exact`` or ``splat``; the last two arguments are the splats' (see SplatRenderer)."""
    from warpsplat.render_exact import ExactRenderer
    from warpsplat.render_splat import SplatRenderer

    if name == "exact":
        return ExactRenderer(parameters, width, height, scale, threads=threads, capacity=capacity)
    return SplatRenderer(
        parameters,
        width,
        height,
        scale,
        threads=threads,
        capacity=capacity,
        through_scales=through_scales,
        fold=fold,
    )


def render(
    scene: Scene,
    *,
    renderer: str = "exact",
    scale: float = 1.0,
    device: wp.Device | str | None = None,
    threads: int | None = None,
) -> FloatArray:
    """Render ``scene`` at ``scale`` px per canvas unit, as its file looks (``exact``) or with splats.

    Samples follow the size in pixels, so a scene can be rendered at any size (paper section 3.3).

    Returns:
        sRGB in [0, 1], shape (height, width, 3).
    """
    target = wp.get_device(device)
    width, height = max(1, round(scene.width * scale)), max(1, round(scene.height * scale))
    made = make_renderer(renderer, Parameters(scene, target), width, height, scale, threads=threads)
    made.forward_complete()
    return made.read_image()
