"""Levels of detail: the first shapes of a scene, rendered alone and compared with the image as well."""

from __future__ import annotations

from warpsplat.fit.losses import LossInputs, image_program
from warpsplat.kernels import levels
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program


def level_programs(inputs: LossInputs, whole: Parameters) -> tuple[Program, ...]:
    """Return programs that render a level, compare, back-propagate and add the gradients to the scene's.

    Args:
        inputs: of the level, its renderer that of the first shapes.
        whole: all shapes.
    """
    renderer = inputs.renderer
    add = renderer.backend.program("levels")
    for name, group in renderer.parameters.groups.items():
        if group.value.shape[0] > 0:
            add.launch(
                levels.add_gradients,
                group.value.shape,
                part=group.grad,
                weight=inputs.settings.level_weight,
                grad=whole.groups[name].grad,
                split=True,
            )
    return renderer.forward_program, image_program(inputs), renderer.backward_program, add
