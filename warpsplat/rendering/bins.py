"""The binning stage: which shapes cover which tiles, front to back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import warp as wp

from warpsplat.kernels import bins
from warpsplat.rendering.backend import Backend, Viewport, buffer
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.ranges import record_ranges


@dataclass
class BinBuffers:
    """Arrays that the stage owns. A slot is one (shape, tile) pair."""

    shape_tiles: wp.array = buffer(wp.int32, "shapes", 4)
    """Rectangle of tiles of each shape: x0, y0, x1, y1, ends excluded."""
    front_slots: wp.array = buffer(wp.int32, "shapes")
    front_ends: wp.array = buffer(wp.int32, "shapes")
    slot_range: wp.array = buffer(wp.vec2i, "shapes")
    """First, and one past the last."""
    slot_shape: wp.array = buffer(wp.int32, "slots")
    """-1 for those not in use."""
    slot_tile: wp.array = buffer(wp.int32, "slots")
    slot_state: wp.array = buffer(wp.int32, "slots")
    """Sums of ``constants.COVERED``, ``UNCOVERED`` and ``HIDDEN``."""
    sort_keys: wp.array = buffer(wp.int32, "sorted")
    """The second half of both is the sort's scratch memory."""
    sort_slots: wp.array = buffer(wp.int32, "sorted")
    tile_range: wp.array = buffer(wp.vec2i, "tiles")
    """A tile's visible slots in the two lists: the first, and one past the last."""
    tile_shapes: wp.array = buffer(wp.int32, "tiles")
    tile_cache: wp.array = buffer(wp.int32, "tiles")
    """0, ``constants.CACHEABLE`` or ``CACHED``."""
    list_slot: wp.array = buffer(wp.int32, "slots")
    list_paint: wp.array = buffer(wp.vec4, "slots")


class Bins:
    """Each tile's list of slots, sorted front to back."""

    def __init__(
        self,
        backend: Backend,
        parameters: Parameters,
        viewport: Viewport,
        capacity: int,
        needed: wp.array,
        *,
        opacity_limit: float = 1.0,
    ) -> None:
        """``opacity_limit``: see ``bins.list_visible``."""
        self._opacity_limit = opacity_limit
        self._parameters, self._viewport = parameters, viewport
        self._capacity, self._needed = capacity, needed
        self.paint: dict[str, wp.array] = {}
        """Arrays that the lists read in place of the parameters' of these names."""
        sizes = {
            "shapes": parameters.shape_count,
            "slots": capacity,
            "sorted": 2 * capacity,
            "tiles": viewport.tile_count,
        }
        self.buffers = backend.allocate(BinBuffers, sizes)

    def forward(self, program: Program, samples: dict[str, Any]) -> None:
        """Record samples -> slots, sorted by tile."""
        b, shapes = self.buffers, self._parameters.shape_count
        program.launch(bins.rectangles, shapes, b, samples, self._viewport, split=True)
        ranges = (b.front_slots, b.front_ends, b.slot_range)
        record_ranges(program, *ranges, self._needed, capacity=self._capacity, reverse=True)
        program.launch(bins.fill_slots, self._capacity, b, self._viewport, split=True)
        # The keys of unused slots, INT_MAX, are still the largest in these bits.
        bits = self._viewport.tile_count.bit_length()
        program.call(wp.utils.radix_sort_pairs, b.sort_keys, b.sort_slots, self._capacity, 0, bits)

    def list_visible(self, program: Program) -> None:
        """Record states of slots -> each tile's list of those that are seen."""
        program.launch(
            bins.list_visible,
            self._viewport.tile_count,
            self.buffers,
            self._parameters.arrays,
            slot_capacity=self._capacity,
            opacity_limit=self._opacity_limit,
            keeps_colors=int(self._parameters.keeps_colors),
            split=True,
            **self.paint,
        )


@dataclass(frozen=True)
class StageInputs:
    """Inputs and capacities of the stages of a coverage model."""

    backend: Backend
    parameters: Parameters
    viewport: Viewport
    bins: Bins
    samples: int
    """Capacity for samples."""
    slots: int
    """Capacity for slots."""
    needed: wp.array
    """Counter of the need for samples, shape (1,)."""
