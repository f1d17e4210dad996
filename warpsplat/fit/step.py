"""A training step: render, compare with the target, back-propagate, update."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import warp as wp

from warpsplat.alpha import squares
from warpsplat.fit import losses
from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.importance import weights_at
from warpsplat.fit.losses import LossInputs, LossTarget, level_programs
from warpsplat.fit.objective import Objective
from warpsplat.fit.optimizer import record_adam
from warpsplat.fit.progress import Snapshot
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.schedule import Phase
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.portable import elementary, filters
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.forms import record_gather
from warpsplat.rendering.program import Program, Replay
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.rendering.tiles import read_tiles
from warpsplat.scene import FloatArray
from warpsplat.scene.scene import level_ends


class Target:
    """The image at the size of a phase, with weights of its pixels."""

    def __init__(
        self,
        image: FloatArray,
        phase: Phase,
        weights: FloatArray | None = None,
        loss: CustomLoss | None = None,
    ) -> None:
        """Reduce an image (see ``Problem.target``) and weights to the phase's size, by area.

        ``weights``: of the pixels, shape (height, width) of any size and scale; default: all equal.
        ``loss``: joins or replaces the squared error.
        """
        self.loss = loss
        self.phase = phase
        height, width = image.shape[:2]
        size = (phase.width, phase.height)
        reduced = image if size == (width, height) else filters.resize_area(image, size)
        self.image = np.ascontiguousarray(reduced, np.float32)
        self.weights = None if weights is None else weights_at(weights, *size)
        """Shape (height, width), mean 1."""
        self.viewport = Viewport(*size, phase.width / width)
        self.slack = phase.slack


class Step:
    """The launches of a training step, recorded for the arrays of ``state`` as they are.

    When shapes come or go the arrays change: the step then refuses to run until ``rebuild`` records it again.
    """

    def __init__(
        self,
        state: FitState,
        settings: Settings,
        target: Target,
        *,
        capacity: Capacity | None = None,
        began: int | None = None,
    ) -> None:
        """Allocate the renderers and record the launches.

        ``capacity``: of the renderer's arrays; default: as much as a first render needs. ``began``: steps
        done when the step was first recorded, by which scheduled weights go; default: now.
        """
        self.state, self.settings = state, settings
        self._aim(target, capacity, began)

    def aim(self, target: Target) -> None:
        """Continue with another target: at another size, or with another loss.

        Adam's moments are scaled by how much steeper another loss is.
        """
        before = None if target.loss is self.target.loss else self.slope()
        self._aim(target)
        if before is not None:
            self.state.parameters.scale_moments(self.slope() / max(before, 1e-12))

    def _aim(self, target: Target, capacity: Capacity | None = None, began: int | None = None) -> None:
        self.target = target
        self.loss_target = self._new_loss_target()
        """Target that renders are compared with: the image, or what ``evaluate_file`` makes of it."""
        self._allocate(capacity, began)

    def rebuild(self) -> None:
        """Allocate and record again, for the state's new arrays."""
        self._allocate(self.renderer.capacity)

    def _new_loss_target(self) -> LossTarget:
        target, backend = self.target, self.state.parameters.backend
        return LossTarget(target.image, backend, target.viewport, target.weights, target.loss)

    def _allocate(self, capacity: Capacity | None, began: int | None = None) -> None:
        """Make the renderers, and record the launches."""
        state, target = self.state, self.target
        self.began = state.step if began is None else began
        model = renderer_of(self.settings.renderer).model(self.settings, self.began, target.slack)
        self.renderer = Renderer(state.parameters, target.viewport, model=model, capacity=capacity)
        levels = [state.parameters.prefix(end) for end in level_ends(state.parameters.structure)]
        self.level_renderers = [Renderer(level, target.viewport, model=model) for level in levels]
        self._level_target = self._new_loss_target() if levels else self.loss_target
        if self.settings.density.interval:
            self.renderer.expect_removal_costs()
        self._prepare()  # before the first launch runs, so that all kernels are compiled side by side
        unsized = self.renderers if capacity is None else self.level_renderers
        if any([renderer.forward_complete() for renderer in unsized]):
            self._prepare()
        self.replay = self._replay()

    def record(self) -> None:
        """Record the launches for the arrays and settings as they are now."""
        self._prepare()
        self.replay = self._replay()

    def _replay(self) -> Replay:
        return Replay(self.renderer.backend.device, self.programs, captured=not self.target.loss)

    def _prepare(self) -> None:
        """Make the programs."""
        self.renderer.check_current()
        backend, state = self.renderer.backend, self.state
        inputs = LossInputs(self.renderer, self.loss_target, self.settings, state.clock)
        update = backend.program("update")
        beside_forms = [backend.program("update")] if state.parameters.forms else []
        if state.parameters.curves:  # the outlines of forms are smooth by themselves
            for loss in losses.SHAPE_LOSSES:
                loss.record(beside_forms[0] if beside_forms else update, inputs)
        for program in beside_forms:
            record_gather(program, state.parameters)  # with what the losses added
        record_adam(update, state.parameters, state.clock, self.settings)
        compare = losses.image_program(inputs)
        self.objective = Objective(inputs, compare)
        """Judges shapes between steps."""
        target = self._level_target
        levels = [replace(inputs, renderer=renderer, target=target) for renderer in self.level_renderers]
        self.programs: tuple[Program, ...] = (
            self.renderer.forward_program,  # render
            compare,
            self.renderer.backward_program,  # back-propagate
            *beside_forms,
            *(program for level in levels for program in level_programs(level, state.parameters)),
            update,
        )

    def advance(self) -> None:
        """Do the step. Nothing is allocated or read back."""
        self.renderer.check_current()
        self.replay()
        self.state.step += 1

    def time(self, count: int) -> None:
        """Render, compare and back-propagate ``count`` times without an update, to be timed."""
        self.renderer.check_current()
        for _ in range(count):
            for program in self.programs[:-1]:
                program.run()
        wp.synchronize_device(self.renderer.backend.device)

    @property
    def renderers(self) -> tuple[Renderer, ...]:
        """The renderer of the whole scene, and those of the levels."""
        return (self.renderer, *self.level_renderers)

    def ensure_capacity(self) -> None:
        """Enlarge arrays that were too small in the last steps."""
        grown = [renderer.grow() for renderer in self.renderers]
        if any(grown):
            self.record()

    def render(self) -> None:
        """Render the current shapes without leaving any out."""
        if self.renderer.forward_complete():
            self.record()

    def configure(self, settings: Settings) -> None:
        """Continue with other settings."""
        self.settings = settings
        self.record()

    def measured_error(self) -> float:
        """Return the mean squared error of the last render. Reads a number per tile back."""
        self.programs[1].run()
        return self.loss_target.mean_square()

    def slope(self) -> float:
        """Render, and return the length of the loss's gradient by the image. Reads the gradient back."""
        self.render()
        self.programs[1].run()
        square = squares(read_tiles(self.renderer.film.buffers.image_grad))
        return float(np.sqrt(square.sum(dtype="float64")))

    def psnr(self) -> float:
        """Return the PSNR of the last step's loss, at its size [dB]: that of the render, or once the file has
        been evaluated an estimate of the file's. Reads a number per tile back.
        """
        return _decibels(self.loss_target.mean_square())

    def render_psnr(self) -> float:
        """Return the PSNR of the last render against the image, at its size [dB]. Reads the render back."""
        difference = squares(self.renderer.read_image() - self.target.image)
        return _decibels(difference.mean(dtype="float64") / 3)

    def snapshot(self) -> Snapshot:
        """Return the current shapes and render, for callbacks."""
        return Snapshot(self.state.scene, self.renderer.read_image, self.state.past)


def _decibels(error: float) -> float:
    return -10 * float(elementary.log10(max(error, 1e-12)))
