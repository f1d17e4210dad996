"""Levels of detail: the first shapes of a scene, rendered alone and compared with the image as well."""

from __future__ import annotations

from dataclasses import dataclass

from warpsplat.fit import losses
from warpsplat.fit.losses import LossInputs, LossTarget
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.kernels import levels
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import Model
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import Renderer


@dataclass(frozen=True)
class Level:
    """The first shapes of a state's scene with a renderer of their own."""

    state: FitState
    renderer: Renderer
    target: LossTarget

    @staticmethod
    def of(state: FitState, count: int, viewport: Viewport, model: Model, target: LossTarget) -> Level:
        """Return the level of the first ``count`` shapes; valid until the next densification step."""
        renderer = Renderer(state.parameters.prefix(count), viewport, model=model)
        renderer.forward_complete()
        return Level(state, renderer, target)

    def programs(self, settings: Settings) -> tuple[Program, ...]:
        """Return programs that render, compare, back-propagate and add the gradients to the scene's."""
        renderer = self.renderer
        measure = renderer.backend.program("loss")
        inputs = LossInputs(renderer, self.target, settings, self.state.clock)
        for loss in losses.IMAGE_LOSSES:
            loss.record(measure, inputs)
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
