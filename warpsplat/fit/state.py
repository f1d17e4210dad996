"""All that a run carries from step to step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import warp as wp

from warpsplat.fit.constraints import Projection
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Moments, Parameters
from warpsplat.scene import Scene
from warpsplat.svg.write import GRIDS


@dataclass(frozen=True, eq=False)
class Past:
    """What the optimizer knows of shapes. Without it they would begin anew, with steps as large as they can
    be: that undoes what they had come to (docs/experiments.md).
    """

    moments: Moments
    """Adam's."""
    ages: npt.NDArray[np.int32]
    """Steps since each was placed, shape (shape,)."""


@dataclass
class FitState:
    """What a run continues from: with this and its settings the rest follows."""

    parameters: Parameters
    """Values, moments and ages."""
    clock: wp.array
    """Steps done, on the device, shape (1,)."""
    rng: np.random.Generator
    step: int = 0
    """Steps done."""
    per_pixel: float = GRIDS[-1]
    """Units of the file's view box a pixel."""
    projection: Projection | None = None
    """Onto the constraints of the outlines, if they have any."""
    base: int = 0
    """Shapes of earlier levels (``fit.layered``), which keep their number: the first ones."""
    opacities_frozen: bool = False
    """Whether the opacities are rounded and frozen."""
    rounding: bool = False
    """Whether coordinates are being rounded and held, in stages."""
    colored: int = -1
    """Revision of the parameters at the last choice of colours (``fit.palette``); -1: there was none."""
    recovered: int = 0
    """Times that a shape was reset because a number was not finite (``fit.recover``)."""

    @staticmethod
    def start(
        scene: Scene,
        backend: Backend,
        rng: np.random.Generator,
        step: int = 0,
        base: int = 0,
        past: Past | None = None,
    ) -> FitState:
        """Before the first step; ``step``: those that count as done. Without a ``past`` shapes are new."""
        clock = backend.array(wp.int32, 1)
        clock.fill_(step)
        known = (past.moments, past.ages) if past else (None, None)
        return FitState(Parameters(scene, backend, *known), clock, rng, step, base=base)

    @property
    def shape_count(self) -> int:
        """Shapes that are drawn: pictures which a file keeps are none."""
        return self.parameters.shape_count - len(self.parameters.pictures)

    def scene(self) -> Scene:
        """The current scene, on the host."""
        return self.parameters.scene()

    def past(self) -> Past:
        """Of the current scene, on the host."""
        return Past(self.parameters.moments(), self.parameters.arrays["ages"].numpy().copy())
