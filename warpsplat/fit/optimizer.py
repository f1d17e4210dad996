"""Adam over the table of attributes."""

from __future__ import annotations

import warp as wp

from warpsplat.fit.settings import Settings
from warpsplat.fit.units import Units
from warpsplat.kernels import adam
from warpsplat.render.parameters import Parameters
from warpsplat.render.program import Program


def record_adam(
    program: Program, parameters: Parameters, clock: wp.array, settings: Settings, units: Units
) -> None:
    """Record the count of the step and the update of every attribute that some shape has.

    ``clock``: steps so far, on the device, shape (1,).
    """
    program.launch(adam.advance, parameters.shape_count, parameters.arrays, clock=clock)
    for name, group in parameters.groups.items():
        attribute = group.attribute
        if not parameters.kinds & set(attribute.kinds):
            continue
        program.launch(
            adam.adam_update,
            group.value.shape,
            group,
            parameters.arrays,
            kinds=sum(1 << kind for kind in attribute.kinds),
            clock=clock,
            step_count=settings.iterations,
            rate=units.resolve(settings.rates[name], attribute.rate_unit),
            final=settings.final_rate,
            low=units.resolve(*attribute.low),
            high=units.resolve(*attribute.high),
            split=True,
        )
