"""Levels: the first shapes of a scene as pictures of their own, in the loss beside the whole one."""

from __future__ import annotations

from dataclasses import dataclass

from warpsplat.fit import losses
from warpsplat.fit.losses import Aim, LossInputs
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.kernels import levels
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import Model
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import Renderer


@dataclass(frozen=True)
class Level:
    """The first shapes of a state's scene, rendered without the others and compared with the image."""

    state: FitState
    renderer: Renderer
    aim: Aim

    @staticmethod
    def of(state: FitState, count: int, viewport: Viewport, model: Model, aim: Aim) -> Level:
        """Of the first ``count`` shapes, as they are until the next surgery."""
        renderer = Renderer(state.parameters.prefix(count), viewport, model=model)
        renderer.forward_complete()
        return Level(state, renderer, aim)

    def programs(self, settings: Settings) -> tuple[Program, ...]:
        """Render, compare, adjoint, and add the gradients to those of the whole picture."""
        renderer = self.renderer
        measure = renderer.backend.program("loss")
        for record in losses.IMAGE_LOSSES:
            record(measure, LossInputs(renderer, self.aim, settings, self.state.clock))
        add = renderer.backend.program("levels")
        for name, group in renderer.parameters.groups.items():
            if group.value.shape[0] > 0:
                add.launch(
                    levels.add_gradients,
                    group.value.shape,
                    part=group.grad,
                    weight=settings.level_weight,
                    grad=self.state.parameters.groups[name].grad,
                    split=True,
                )
        return renderer.forward_program, measure, renderer.backward_program, add
