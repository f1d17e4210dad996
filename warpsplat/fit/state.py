"""All that a run carries from step to step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from warpsplat.fit.constraints import Keeper
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.scene import Scene
from warpsplat.svg.write import GRIDS


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
    keeper: Keeper | None = None
    """What outlines keep, where they have conditions."""
    base: int = 0
    """Shapes of earlier levels (``fit.layered``), which keep their number: the first ones."""
    settled: bool = False
    """Whether the opacities are rounded and held."""
    rounding: bool = False
    """Whether coordinates are being rounded and held, in stages."""
    colored: int = -1
    """Revision of the parameters at the last choice of colours (``fit.palette``); -1: there was none."""
    renewed: int = 0
    """Times that a shape was set anew since a number of its was not finite (``fit.mend``)."""

    @staticmethod
    def start(
        scene: Scene, backend: Backend, rng: np.random.Generator, step: int = 0, base: int = 0
    ) -> FitState:
        """Before the first step; ``step``: those that count as done."""
        clock = backend.array(wp.int32, 1)
        clock.fill_(step)
        return FitState(Parameters(scene, backend), clock, rng, step, base=base)

    @property
    def shape_count(self) -> int:
        """Shapes that are drawn: pictures which a file keeps are none."""
        return self.parameters.shape_count - len(self.parameters.pictures)

    def scene(self) -> Scene:
        """The current scene, on the host."""
        return self.parameters.scene()
