"""Choosing the number of steps so that a fit ends at its deadline."""

from __future__ import annotations

import time
from dataclasses import replace

from warpsplat.fit.schedule import CHECK_INTERVAL, phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.scene import FloatArray

TIMED_STEPS = 4
"""Steps that are timed at each size."""

BUDGET_MARGIN = 1.25
"""Time of a step with its update and its share of surgery, over the time measured without."""

MAX_ITERATIONS = 20_000
"""Most steps of a fit with a deadline: more gain nothing."""


class Budget:
    """A deadline (``time.monotonic``), and the time of a step in each phase."""

    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        self.costs: list[float] = []
        """Time of a step in each phase [s]."""

    def over(self) -> bool:
        """Return whether the time is up."""
        return time.monotonic() > self.deadline

    def measure(self, state: FitState, settings: Settings, image: FloatArray) -> Settings:
        """Time a few steps at each size without updates; return ``settings`` with as many steps as fit."""
        for phase in phases(settings, image.shape[1], image.shape[0]):
            step = Step(state, settings, Target(image, phase))
            begin = time.monotonic()
            step.time(TIMED_STEPS)
            self.costs.append(BUDGET_MARGIN * (time.monotonic() - begin) / TIMED_STEPS)
        return self.fit(settings, 0, 1.0)

    def fit(self, settings: Settings, done: int, slowness: float) -> Settings:
        """Return ``settings`` with as many steps as end by the deadline, ``done`` of which are made.

        Args:
            settings: of the fit.
            done: steps so far.
            slowness: actual time of a step over the one measured.
        """
        coarse = settings.coarse if len(self.costs) == 2 else 0.0
        mean = coarse * self.costs[0] + (1 - coarse) * self.costs[-1]
        spent = done * (self.costs[0] if done < coarse * settings.iterations else mean)
        left = (self.deadline - time.monotonic()) / slowness
        # Time spent and time left add up to the whole fit; the steps made so far were the cheap, coarse ones.
        iterations = int((spent + max(left, 0.0)) / mean)
        return replace(settings, iterations=min(max(iterations, done, CHECK_INTERVAL), MAX_ITERATIONS))
