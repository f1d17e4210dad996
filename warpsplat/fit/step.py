"""A training step: render, compare, adjoint, update."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpsplat.alpha import squares
from warpsplat.fit import losses
from warpsplat.fit.importance import weights_at
from warpsplat.fit.levels import Level
from warpsplat.fit.losses import Aim, LossInputs
from warpsplat.fit.optimizer import record_adam
from warpsplat.fit.schedule import Phase, fold_weight
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.units import Units
from warpsplat.fit.work import Snapshot
from warpsplat.portable import elementary, filters
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import ExactModel, GaussianModel, Model, SplatModel
from warpsplat.rendering.program import Program, capture
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.scene import FloatArray


class Target:
    """The image at the size of a phase, and what the error of its pixels counts."""

    def __init__(self, image: FloatArray, phase: Phase, weights: FloatArray | None = None) -> None:
        """Both are reduced by area to the phase's size.

        Args:
            image: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height,
                width, 4).
            phase: the size.
            weights: of the pixels, shape (height, width) of any size and scale; without, all count alike.
        """
        self.phase = phase
        height, width = image.shape[:2]
        size = (phase.width, phase.height)
        reduced = image if size == (width, height) else filters.resize_area(image, size)
        self.image = np.ascontiguousarray(reduced, np.float32)
        self.weights = None if weights is None else weights_at(weights, *size)
        """Shape (height, width), mean 1."""
        self.viewport = Viewport(*size, phase.width / width)
        self.slack = phase.slack


def model_for(settings: Settings, step: int, slack: float = 1.0) -> Model:
    """The settings' model of coverage, as it is after ``step`` steps, with a phase's ``slack``."""
    if settings.renderer == "splat":
        return SplatModel(settings.through_scales, fold_weight(settings, step))
    if settings.renderer == "gaussian":
        fold = fold_weight(settings, step)
        return GaussianModel(settings.softness, settings.gaussian_density, settings.through_scales, fold)
    return ExactModel(slack=slack)


class Step:
    """The launches of a step, recorded for the arrays of ``state`` as they are.

    After surgery on the state a new one is made (``after_surgery``); this one then refuses to run.
    """

    def __init__(
        self,
        state: FitState,
        settings: Settings,
        target: Target,
        *,
        capacity: Capacity | None = None,
        aim: Aim | None = None,
        level_aim: Aim | None = None,
        began: int | None = None,
    ) -> None:
        """Without ``capacity``, the need is found by rendering.

        ``level_aim``: what the pictures of the first levels are compared with; default: the image.
        ``began``: steps that were done when it was made, if not those of now: weights go by that.
        """
        self.state, self.settings, self.target = state, settings, target
        self.began = state.step if began is None else began
        self.renderer = Renderer(
            state.parameters,
            target.viewport,
            model=model_for(settings, self.began, target.slack),
            capacity=capacity,
        )
        self.aim = aim or self._aim()
        if capacity is None:
            self.renderer.forward_complete()
        ends = state.parameters.level_ends
        self.level_aim = level_aim or (self._aim() if ends else None)
        self.levels = [self._level(end, self.level_aim) for end in ends if self.level_aim]
        self.record()

    def _aim(self) -> Aim:
        """At the image."""
        return Aim(self.target.image, self.renderer.backend, self.target.viewport, self.target.weights)

    def _level(self, end: int, aim: Aim) -> Level:
        model = model_for(self.settings, self.began, self.target.slack)
        return Level.of(self.state, end, self.target.viewport, model, aim)

    def record(self) -> None:
        """Record the launches for the arrays and settings as they are now."""
        self.renderer.check_current()
        backend, parameters = self.renderer.backend, self.state.parameters
        measure = backend.program("loss")
        inputs = LossInputs(self.renderer, self.aim, self.settings, self.state.clock)
        for record in losses.IMAGE_LOSSES:
            record(measure, inputs)
        update = backend.program("update")
        for record_shapes in losses.SHAPE_LOSSES:
            record_shapes(update, parameters, self.settings)
        units = Units.of(self.settings, parameters.canvas)
        keeper = self.state.keeper
        if keeper:
            keeper.record_adjoint(update)
        record_adam(update, parameters, self.state.clock, self.settings, units)
        if keeper:
            keeper.record_project(update)
        self.programs: tuple[Program, ...] = (
            self.renderer.forward_program,
            measure,
            self.renderer.backward_program,
            *(program for level in self.levels for program in level.programs(self.settings)),
            update,
        )
        self._graph = capture(backend.device, self.programs)

    def advance(self) -> None:
        """Do the step. Nothing is allocated or read back."""
        self.renderer.check_current()
        if self._graph:
            wp.capture_launch(self._graph)
        else:
            for program in self.programs:
                program.run()
        self.state.step += 1

    def time(self, count: int) -> None:
        """Render, compare and adjoint ``count`` times, without an update; for timing."""
        self.renderer.check_current()
        for _ in range(count):
            for program in self.programs[:-1]:
                program.run()
        wp.synchronize_device(self.renderer.backend.device)

    @property
    def renderers(self) -> tuple[Renderer, ...]:
        """Of the whole picture, and of the levels'."""
        return (self.renderer, *(level.renderer for level in self.levels))

    def make_room(self) -> None:
        """Where the last steps ran out of capacity, go on with larger arrays."""
        grown = [renderer.grow() for renderer in self.renderers]
        if any(grown):
            self.record()

    def render(self) -> None:
        """Render what there is now, all of it."""
        if self.renderer.forward_complete():
            self.record()

    def configure(self, settings: Settings) -> None:
        """Go on with other settings."""
        self.settings = settings
        self.record()

    def after_surgery(self) -> Step:
        """A step for the state's new arrays, at the same size."""
        return Step(
            self.state,
            self.settings,
            self.target,
            capacity=self.renderer.capacity,
            aim=self.aim,
            level_aim=self.level_aim,
        )

    def square_error(self) -> float:
        """Mean squared error of the last render against what it is compared with. Reads the render back."""
        difference = self.renderer.film.buffers.image.numpy() - self.aim.target.numpy()
        errors = squares(difference, axis=1) * self.renderer.film.buffers.inside.numpy()
        return float(errors.sum(dtype="float64")) / self.aim.value_count

    def measured_error(self) -> float:
        """As ``square_error``, of the image only, summed up on the device: reads a number a tile back."""
        self.programs[1].run()
        return self.aim.mean_square()

    def lacking(self) -> FloatArray:
        """What the last render lacks of what it is compared with, by colour.

        Of a transparent picture, the mean of what it lacks on black and on white. Copies both to the host.

        Returns:
            shape (tile, 3, TILE, TILE).
        """
        lacking = self.aim.target.numpy() - self.renderer.film.buffers.image.numpy()
        if lacking.shape[1] == 4:
            lacking = lacking[:, :3] - 0.5 * lacking[:, 3:]
        return np.asarray(lacking, np.float32)

    def weights(self) -> FloatArray:
        """What the error of each pixel counts, 0 outside of the image, shape (tile, TILE, TILE)."""
        weights = self.aim.importance if self.aim.weighted else self.renderer.film.buffers.inside
        return np.asarray(weights.numpy(), np.float32)

    def psnr(self) -> float:
        """What the loss of the last step stands for, at its size [dB]: the render's PSNR, and from the first
        look at the file on, an estimate of the file's. Reads a number a tile back from the device.
        """
        return -10 * float(elementary.log10(max(self.aim.mean_square(), 1e-12)))

    def render_psnr(self) -> float:
        """Of the last render against the image, at its size [dB]. Reads the render back from the device."""
        error = squares(self.renderer.read_image() - self.target.image).mean(dtype="float64") / 3
        return -10 * float(elementary.log10(max(error, 1e-12)))

    def snapshot(self) -> Snapshot:
        """What there is now, for people to look at."""
        return Snapshot(self.state.scene, self.renderer.read_image, self.state.past)
