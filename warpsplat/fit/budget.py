"""Fitting a run into a time."""

from __future__ import annotations

import time
from dataclasses import replace

from warpsplat.fit.schedule import CHECK_INTERVAL, phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.scene import FloatArray

TIMED_STEPS = 4
"""Steps timed at each size."""

BUDGET_MARGIN = 1.25
"""What a step costs with its update and its share of surgery, over what was timed."""

MAX_ITERATIONS = 20_000
"""Most steps that a time budget can buy: beyond, nothing is gained."""


class Budget:
    """A deadline, and what a step costs in each phase."""

    def __init__(self, seconds: float) -> None:
        """``seconds``: from now until the run has to be over."""
        self.deadline = time.monotonic() + seconds
        self.costs: list[float] = []
        """Of a step in each phase [s]."""

    def over(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() > self.deadline

    def measure(self, state: FitState, settings: Settings, image: FloatArray) -> Settings:
        """Time a few steps without update at each size; ``settings`` with iterations that fit."""
        for phase in phases(settings, image.shape[1], image.shape[0]):
            step = Step(state, settings, Target(image, phase))
            begin = time.monotonic()
            step.time(TIMED_STEPS)
            self.costs.append(BUDGET_MARGIN * (time.monotonic() - begin) / TIMED_STEPS)
        return self.fit(settings, 0, 1.0)

    def fit(self, settings: Settings, done: int, slowness: float) -> Settings:
        """``settings`` with iterations that fit the deadline after ``done`` steps.

        ``slowness``: true cost of a step over the one measured.
        """
        coarse = settings.coarse if len(self.costs) == 2 else 0.0
        mean = coarse * self.costs[0] + (1 - coarse) * self.costs[-1]
        spent = done * (self.costs[0] if done < coarse * settings.iterations else mean)
        left = (self.deadline - time.monotonic()) / slowness
        # What is spent and left is the whole run's price; the steps done were the cheap, coarse ones.
        iterations = int((spent + max(left, 0.0)) / mean)
        return replace(settings, iterations=min(max(iterations, done, CHECK_INTERVAL), MAX_ITERATIONS))
