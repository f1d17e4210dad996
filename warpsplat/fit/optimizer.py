"""Adam over the table of attributes."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.kernels import adam
from warpsplat.rendering.backend import buffer, view
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.scene import Canvas, Unit


@dataclass
class AdamBuffers:
    """Values that the updates of a step share."""

    biases: wp.array = buffer(wp.vec2, "shapes")
    """Bias correction of each shape's first and second moments at its age."""
    decay: wp.array = buffer(wp.float32, 1)
    """Factor of the learning rates at this step."""


def record_adam(program: Program, parameters: Parameters, clock: wp.array, settings: Settings) -> None:
    """Record the step's advance of the clock and the update of every attribute that some shape has.

    ``clock``: steps done, on the device, shape (1,).
    """
    if parameters.has_twins:
        grad = parameters.groups["points"].grad
        points_grad = view(grad, wp.vec2, grad.shape[:1])
        program.launch(adam.tie_twins, grad.shape[0], parameters.arrays, points_grad=points_grad)
    if parameters.has_circles:
        from warpsplat.kernels.paint import gradient_backward  # takes long to import

        program.launch(gradient_backward.tie_circles, parameters.shape_count, parameters.arrays)
    units = units_of(settings, parameters.structure.canvas)
    buffers = parameters.backend.allocate(AdamBuffers, {"shapes": parameters.shape_count})
    program.launch(
        adam.advance,
        parameters.shape_count,
        buffers,
        parameters.arrays,
        clock=clock,
        step_count=settings.iterations,
        final=settings.final_rate,
        beta1=settings.beta1,
        beta2=settings.beta2,
    )
    for name, group in parameters.groups.items():
        attribute = group.attribute
        if not (parameters.kinds & set(attribute.kinds) and parameters.paints & set(attribute.paints)):
            continue
        program.launch(
            adam.adam_update,
            group.value.shape,
            group,
            buffers,
            parameters.arrays,
            broken=parameters.broken,
            kinds=sum(1 << kind for kind in attribute.kinds),
            paints=sum(1 << paint for paint in attribute.paints),
            beta1=settings.beta1,
            beta2=settings.beta2,
            rate=settings.rates[name] * units[attribute.rate_unit],
            low=attribute.low[0] * units[attribute.low[1]],
            high=attribute.high[0] * units[attribute.high[1]],
            split=True,
        )


def units_of(settings: Settings, canvas: Canvas) -> dict[Unit, float]:
    """Return the length of each unit in canvas units; values without a unit stay as they are.

    A pixel is one of the finest training size, so that learning rates do not depend on the image's size.
    """
    finest = phases(settings, canvas.width, canvas.height)[-1]
    pixel = canvas.width / finest.width
    return {Unit.ONE: 1.0, Unit.PIXEL: pixel, Unit.CANVAS: float(max(canvas.width, canvas.height))}
