"""Runs on one image with more and more shapes, each of which begins with what the one before had found.

A run is a third of its way when as many shapes are there as a smaller run had when it was that far and
further: from those it goes on. What was tried besides is in docs/experiments.md.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from warpsplat.fit.settings import Settings
from warpsplat.fit.work import Progress, Report, run_cost, score_cost
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Scene

BEGIN = 0.375
"""Share of a run's steps that are left out where it begins with the shapes of a smaller one."""

EXTRA = 1.1
"""Steps of such a run's schedule over those of another one: what it has left is 0.69 of these."""


@dataclass(frozen=True)
class Start:
    """How a run begins."""

    settings: Settings
    scene: Scene | None = None
    """Shapes to begin with; None: new ones."""
    begin: int = 0
    """Step of the schedule."""


def _longer(settings: Settings) -> Settings:
    """Of a run that begins with the shapes of a smaller one: what is missing comes at once, so that it is as
    old as can be in the end.
    """
    density = replace(settings.density, start=1.0)
    return replace(settings, iterations=round(EXTRA * settings.iterations), density=density)


def _begin(settings: Settings) -> int:
    """The step at which such a run begins: one of surgery."""
    turn = max(settings.density.interval, 1)
    return max(1, round(BEGIN * settings.iterations) // turn * turn)


class Series:
    """Runs of ascending numbers of shapes, one after the other."""

    def __init__(
        self, settings: Settings, numbers: Sequence[int], width: int, height: int, backend: Backend
    ) -> None:
        """``numbers``: of shapes; the image is of ``width`` x ``height`` pixels."""
        self._settings = settings
        self._scene: Scene | None = None
        self._size = width, height
        self._measured = score_cost(width, height, backend, eyes=True)
        self._costs: dict[int, float] = {}
        for first, number in enumerate(sorted(numbers)):
            self._costs[number] = self._cost(number, is_first=first == 0)
        self._started = time.monotonic()

    def _cost(self, number: int, *, is_first: bool) -> float:
        chosen = replace(self._settings, curves=number)
        if is_first:
            return run_cost(chosen, *self._size) + self._measured
        longer = _longer(chosen)
        return run_cost(longer, *self._size, _begin(longer)) + self._measured

    def start(self, number: int) -> Start:
        """Of the run with ``number`` shapes, which has more than the ones before."""
        settings = replace(self._settings, curves=number)
        if self._scene is None:
            return Start(settings)
        longer = _longer(settings)
        return Start(longer, self._scene, _begin(longer))

    def watch(self, start: Start, report: Report | None) -> Report:
        """What the run that begins so reports to: it keeps the shapes that the next one is to begin with, and
        passes on to ``report`` how much of the whole work is done.
        """
        number = start.settings.curves
        before = sum(cost for other, cost in self._costs.items() if other < number)
        share, whole = self._costs[number], sum(self._costs.values())
        is_last = number == max(self._costs)
        taken = False

        def told(now: Progress) -> None:
            nonlocal taken
            full = now.step >= start.settings.density.thin * start.settings.iterations
            if full and not taken and not is_last and now.snapshot:
                self._scene, taken = now.snapshot.scene(), True
            if report:
                work = (before + share * now.work) / whole
                report(replace(now, work=work, seconds=time.monotonic() - self._started))

        return told
