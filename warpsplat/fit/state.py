"""The state that a fit carries from step to step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import warp as wp

from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Moments, Parameters
from warpsplat.scene import Scene
from warpsplat.svg.write import GRIDS


@dataclass(frozen=True, eq=False)
class Past:
    """Optimizer state of shapes. Without it a continued fit starts with the largest steps, which undo much of
    what was reached (docs/experiments.md).
    """

    moments: Moments
    """First and second moments of Adam."""
    ages: npt.NDArray[np.int32]
    """Steps since each shape was placed, shape (shape,)."""


@dataclass
class FitState:
    """State of a fit: with its settings, all that follows depends on this alone."""

    parameters: Parameters
    """Values, moments and ages."""
    clock: wp.array
    """Steps done, on the device, shape (1,)."""
    rng: np.random.Generator
    step: int = 0
    """Steps done."""
    base: int = 0
    """Number of the first shapes, those of earlier levels (``fit.layered``), which stay."""
    opacities_frozen: bool = False
    """Whether the opacities are rounded and frozen."""
    grid: float | None = None
    """View box units per pixel that coordinates are rounded to; None until rounding begins."""
    colored: int = -1
    """Revision of the parameters at the last choice of colours (``fit.palette``); -1: none so far."""
    known: tuple[int, Scene] | None = None
    """The last scene that was read back, and its step: all that is left when the device fails."""
    renewed: int = 0
    """How often a shape was reset because of a number that was not finite (``fit.densification``)."""

    @staticmethod
    def start(
        scene: Scene,
        backend: Backend,
        rng: np.random.Generator,
        step: int = 0,
        base: int = 0,
        past: Past | None = None,
    ) -> FitState:
        """Return the state before the first step, when ``step`` steps count as done."""
        clock = backend.array(wp.int32, 1)
        clock.fill_(step)
        known = (past.moments, past.ages) if past else (None, None)
        return FitState(Parameters(scene, backend, *known), clock, rng, step, base=base)

    @property
    def per_pixel(self) -> float:
        """View box units per pixel in the file."""
        return GRIDS[-1] if self.grid is None else self.grid

    @property
    def shape_count(self) -> int:
        """Number of shapes that are drawn: pictures which a file keeps do not count."""
        return self.parameters.shape_count - len(self.parameters.structure.pictures)

    def scene(self) -> Scene:
        """Return the current scene, on the host."""
        scene = self.parameters.scene()
        if not self.known or self.known[0] != self.step:  # then there may be new shapes, not trained yet
            self.known = self.step, scene
        return scene

    def past(self) -> Past:
        """Return the optimizer state of the current scene, on the host."""
        return Past(self.parameters.moments(), self.parameters.arrays["ages"].numpy().copy())
