"""How many steps fit into the time of a fit, and how many shapes into the bytes of its file."""

from __future__ import annotations

import time
from dataclasses import replace

from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.export import export
from warpsplat.fit.rounding import USUAL_GRID, choose_grid, finest
from warpsplat.fit.schedule import CHECK_INTERVAL, mean_points_at, phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.portable import elementary
from warpsplat.rendering.compiler import compile_seconds
from warpsplat.scene import Basis, FloatArray, Kind

BUDGET_MARGIN = 1.25
"""Time of a step with its update and its share of densification, over the time measured without."""

HEAD_BYTES, FRACTION_BYTES = 150, 1.6
"""Bytes of a file without its shapes, and of a number without its digits before the point."""

STYLE_BYTES = {Kind.FILL: 35, Kind.STROKE: 55}
"""Bytes of a shape without its coordinates."""


class Budget:
    """A deadline (``time.monotonic``; infinite: none), and the time of a step in each phase."""

    def __init__(self, deadline: float) -> None:
        self.deadline = deadline
        self.costs: list[float] = []
        """Time of a step in each phase [s]; none without a deadline, and once the last steps are planned."""
        self._began, self._compiled = time.monotonic(), compile_seconds()

    def over(self) -> bool:
        """Return whether the time is up, and the last steps are not planned yet."""
        return bool(self.costs) and time.monotonic() > self.deadline

    def share(self) -> float:
        """Return the share of the time that is spent, at most 1."""
        spent = time.monotonic() - self._began
        return min(spent / max(self.deadline - self._began, 1e-9), 1.0)

    def measure(
        self, state: FitState, settings: Settings, image: FloatArray, loss: CustomLoss | None = None
    ) -> Settings:
        """Time a few steps at each size without updates; return ``settings`` with as many steps as fit."""
        timed_steps = 4  # steps that are timed at each size
        for phase in phases(settings, image.shape[1], image.shape[0]):
            step = Step(state, settings, Target(image, phase, loss=loss))
            begin = time.monotonic()
            step.time(timed_steps)
            self.costs.append(BUDGET_MARGIN * (time.monotonic() - begin) / timed_steps)
        self._began, self._compiled = time.monotonic(), compile_seconds()
        return self._fit(settings, 0, 1.0)

    def fit(self, step: Step) -> None:
        """Continue with as many steps as end by the deadline, after some at the coarse size."""
        worked = time.monotonic() - self._began - (compile_seconds() - self._compiled)
        done = step.state.step
        step.configure(self._fit(step.settings, done, worked / (done * self.costs[0])))

    def _fit(self, settings: Settings, done: int, slowness: float) -> Settings:
        """Return ``settings`` with as many steps as end by the deadline, after ``done`` steps.

        ``slowness``: actual time of a step over the one measured.
        """
        coarse = settings.coarse if len(self.costs) == 2 else 0.0
        mean = coarse * self.costs[0] + (1 - coarse) * self.costs[-1]
        spent = done * (self.costs[0] if done < coarse * settings.iterations else mean)
        left = (self.deadline - time.monotonic()) / slowness
        # Time spent and time left add up to the whole fit; the steps made so far were the cheap, coarse ones.
        iterations = int((spent + max(left, 0.0)) / mean)
        max_iterations = 20_000  # most steps of a fit with a deadline: more gain nothing
        return replace(settings, iterations=min(max(iterations, done, CHECK_INTERVAL), max_iterations))


def affordable_curves(settings: Settings, width: int, height: int) -> int:
    """Return how many shapes fit into ``max_bytes`` on a canvas of ``width`` x ``height`` px, and a few more.

    Coordinates are relative: each has as many digits before the point as the distance between shapes.
    """
    assert settings.max_bytes
    numbers = 4 + 2 * settings.density.mean_points
    available = settings.max_bytes - HEAD_BYTES
    count = float(settings.curves)
    for _ in range(8):  # settles within a shape
        digits = max(0.0, 0.5 * float(elementary.log10(width * height / max(count, 1.0))))
        count = max(0.0, available / (STYLE_BYTES[settings.kind] + numbers * (FRACTION_BYTES + digits)))
    spare_curves = 1.3  # trained shapes over those expected to fit: the excess is removed with the surplus
    return max(1, min(settings.curves, round(spare_curves * count)))


def affordable(step: Step) -> Settings:
    """Return the settings of a fit whose surplus is being removed, with as many shapes as fit ``max_bytes``.

    A shape counts by its present bytes, less those of the points that it will lose.
    """
    settings, state = step.settings, step.state
    assert settings.max_bytes
    if state.step <= settings.density.thin * settings.iterations:
        return settings
    scene = state.scene()
    coarse = state.step < settings.coarse * settings.iterations
    grid = (
        min(USUAL_GRID, finest(settings)) if coarse else choose_grid(step, staged=True, rate_distortion=True)
    )
    per_shape = (len(export(scene, settings, grid)) - HEAD_BYTES) / max(len(scene), 1)
    splines = scene.basis == Basis.SPLINE
    if splines.any():
        points = float(scene.point_counts()[splines].mean())
        lost = max(0.0, points - mean_points_at(settings, settings.iterations)) / (points + 2)
        per_shape -= lost * max(per_shape - STYLE_BYTES[settings.kind], 0.0)
    # Bytes of a shape in the file over its bytes before the last steps: opacities become 1, the grid coarser.
    shrinkage = 0.92
    count = round((settings.max_bytes - HEAD_BYTES) / max(shrinkage * per_shape, 1.0))
    return replace(settings, curves=min(settings.curves, max(count, 1)))
