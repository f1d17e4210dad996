"""The paint stage: what a shape is coloured with. Flat colour is the only kind so far.

Its forward half is part of compositing, which waits for memory: ``kernels.paint.flat`` is inlined there.
"""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warpsplat.kernels.paint import flat
from warpsplat.kernels.tile import column
from warpsplat.render.backend import Backend, buffer
from warpsplat.render.bins import Bins
from warpsplat.render.parameters import Parameters
from warpsplat.render.program import Program


@dataclass
class PaintBuffers:
    """Gradients of colour (3) and opacity, by slot: as columns where a thread has the tile, else by lane."""

    slot_columns: wp.array = buffer(column, "column_slots", 4)
    slot_grad: wp.array = buffer(wp.vec4, "lane_slots", "lanes")


class Paint:
    """Flat colours."""

    def __init__(self, backend: Backend, parameters: Parameters, bins: Bins, slots: int) -> None:
        self._backend, self._parameters, self._bins = backend, parameters, bins
        whole = backend.lanes == 1
        self.buffers = backend.allocate(
            PaintBuffers,
            {
                "column_slots": slots if whole else 1,
                "lane_slots": 1 if whole else slots,
                "lanes": backend.lanes,
            },
        )

    def backward(self, program: Program) -> None:
        """Record gradients by slot -> gradients of colours and opacities."""
        program.launch(
            flat.flat_backward,
            self._parameters.shape_count,
            self.buffers,
            self._bins.buffers,
            self._parameters.arrays,
            lanes=self._backend.lanes,
            split=True,
        )
