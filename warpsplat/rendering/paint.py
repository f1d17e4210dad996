"""The paint stage: the colours of shapes.

The forward half of flat colours is part of compositing, which is bound by memory: ``kernels.paint.flat`` is
inlined there. Gradients and pictures fill arrays that compositing reads, and replaces by their gradients.
"""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.paint import flat
from warpsplat.rendering.backend import buffer
from warpsplat.rendering.bins import StageInputs
from warpsplat.rendering.pictures import picture_arrays
from warpsplat.rendering.program import Program
from warpsplat.scene import GRADIENTS, Paint


@dataclass
class PaintBuffers:
    """Arrays that the stage owns."""

    slot_columns: wp.array = buffer(None, "column_slots", 4)
    """Gradients of colour (3) and opacity, where one thread handles a tile."""
    slot_grad: wp.array = buffer(wp.vec4, "lane_slots", "lanes")
    """The same by lane, where several threads share a tile."""
    lane_grad: wp.array = buffer(wp.vec4, "lane_shapes", "lanes")
    """The same by shape and lane."""
    paint_columns: wp.array = buffer(None, "paint_slots", 4, "columns")
    """Colour (3) and opacity of the pixels of slots that are not flat."""
    paint_pixels: wp.array = buffer(
        wp.float32, "paint_slots", 4, constants.TILE_PIXELS, memory_of="paint_columns"
    )


class Painting:
    """Flat colours, gradients and pictures."""

    def __init__(self, inputs: StageInputs) -> None:
        self._backend, self._slots = inputs.backend, inputs.slots
        parameters = inputs.parameters
        self._shape_count = parameters.shape_count
        self.has_gradients = bool(parameters.paints & set(GRADIENTS))
        self._pictures = (
            picture_arrays(parameters.structure.pictures, inputs.viewport, self._backend)
            if Paint.PICTURE in parameters.paints
            else None
        )
        self.is_flat = not (self.has_gradients or self._pictures)
        slots, lanes = self._slots, self._backend.lanes
        self.buffers = self._backend.allocate(
            PaintBuffers,
            {
                "column_slots": slots if lanes == 1 else 1,
                "lane_slots": 1 if lanes == 1 else slots,
                "lane_shapes": 1 if lanes == 1 else self._shape_count,
                "lanes": lanes,
                "paint_slots": 1 if self.is_flat else slots,
            },
        )
        self._sources = (self.buffers, inputs.bins.buffers, parameters.arrays, inputs.viewport)

    def forward(self, program: Program) -> None:
        """Record frames and stops, and pictures -> colours of the pixels of visible slots that have such."""
        column, kernels = self._backend.column, []
        if self.has_gradients:
            from warpsplat.kernels.paint.gradient import NAMES
            from warpsplat.kernels.paint.gradient_forward import make_forward  # takes long to import

            kernels += [make_forward(column, case) for case in NAMES]
        if self._pictures:
            from warpsplat.kernels.paint import picture

            kernels.append(picture.make_forward(column))
        for kernel in kernels:
            program.launch(
                kernel,
                (self._slots, self._backend.lanes),
                *self._sources,
                self._pictures or {},
                lane_columns=self._backend.lane_columns,
                split=True,
            )

    def backward(self, program: Program) -> None:
        """Record gradients by slot -> gradients of colours, opacities, frames and stops."""
        shapes, column = self._shape_count, self._backend.column
        if self.has_gradients:
            from warpsplat.kernels.paint.gradient import NAMES
            from warpsplat.kernels.paint.gradient_backward import make_backward

            for case in NAMES:
                kernel = make_backward(column, case)
                program.launch(kernel, shapes, *self._sources, split=True)
        if self._backend.lanes == 1:
            program.launch(flat.flat_backward, shapes, *self._sources, split=True)
        else:
            program.launch(flat.sum_slots, (shapes, self._backend.lanes), *self._sources, split=True)
            program.launch(flat.sum_lanes, shapes, *self._sources, split=True)
