"""Fits of one image with more and more shapes, each of which goes on with what the one before had found.

A fit grows to a surplus, trains it, and thins it. Before it thins, its shapes and what the optimizer knows of
them are kept: from there the next fit grows on, further, and leaves out the beginning of its own schedule.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from warpsplat.fit.costs import Course, score_cost
from warpsplat.fit.options import limits_of
from warpsplat.fit.settings import Density, Settings
from warpsplat.fit.state import Past
from warpsplat.fit.work import Progress, Report
from warpsplat.portable import elementary
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Scene

BEGIN = 0.25, 0.375
"""Share of its schedule that a fit leaves out where it goes on from another one, at the least and at most: in
between, it begins where there would be as many shapes by now (docs/experiments.md).
"""

TURNS = 5
"""In which the number of shapes grows from where it goes on, at the least: many at a time find bad places.
Runs of few steps have fewer, and begin anew.
"""


@dataclass(frozen=True, eq=False)
class Start:
    """What a fit goes on from."""

    scene: Scene
    past: Past | None = None
    """None: the shapes are as new, and their number stays."""
    begin: int = 0
    """Step of its schedule that it begins at."""


class Series:
    """Fits of ascending numbers of shapes, one after the other."""

    def __init__(
        self,
        settings: Settings,
        numbers: Sequence[int],
        width: int,
        height: int,
        backend: Backend,
        *,
        shares: bool = True,
    ) -> None:
        """A series that has not begun.

        Args:
            settings: of all.
            numbers: of shapes.
            width: of the image [px].
            height: likewise.
            backend: where to compute.
            shares: whether fits go on from one another; else each begins anew.
        """
        self._settings, self._shares = settings, shares
        self._numbers = sorted(numbers)
        self._kept: tuple[Scene, Past] | None = None
        self._costs = {}
        for at, number in enumerate(self._numbers):
            chosen, begin = replace(settings, curves=number), self._expected(at, number)
            course = Course.of(chosen, width, height, backend, begin=begin)
            measured = score_cost(width * height, number, backend, eyes=True)
            self._costs[number] = course.cost() + measured
        self._started = time.monotonic()

    def _expected(self, at: int, number: int) -> int:
        """The step at which a fit, the first one being 0, will begin."""
        if at == 0 or not self._shares:
            return 0
        shapes = round(self._settings.density.surplus * self._numbers[at - 1])
        return begin_of(replace(self._settings, curves=number), shapes)

    def next(self, number: int) -> tuple[Settings, Start | None]:
        """The settings of the fit with ``number`` shapes, which are more than those before, and its start."""
        settings = replace(self._settings, curves=number)
        if self._kept is None:
            return settings, None
        scene, past = self._kept
        begin = begin_of(settings, len(scene))
        if begin == 0:
            return settings, None
        return growing(settings, len(scene), begin), Start(scene, past, begin)

    def watch(self, number: int, report: Report | None) -> Report:
        """What the fit with ``number`` shapes reports to: it keeps what the next one begins with, and tells
        ``report`` how much is done of the work of all.
        """
        full = self._settings.density.thin * self._settings.iterations
        before = sum(self._costs[other] for other in self._numbers if other < number)
        share, whole = self._costs[number], sum(self._costs.values())
        waits = self._shares and number != self._numbers[-1]

        def told(now: Progress) -> None:
            nonlocal waits
            if waits and now.step >= full and now.snapshot and now.snapshot.past:
                self._kept, waits = (now.snapshot.scene(), now.snapshot.past()), False
            if report:
                work = (before + share * now.work) / whole
                report(replace(now, work=work, seconds=time.monotonic() - self._started))

        return told


def begin_of(settings: Settings, shapes: int) -> int:
    """The step at which a fit goes on from so many ``shapes``: that of a turn; 0 where it begins anew."""
    density, steps = settings.density, settings.iterations
    if density.interval <= 0:
        return 0
    growth = float(elementary.log(density.surplus / density.start))
    lacking = float(elementary.log(density.surplus * settings.curves / shapes))
    missing = lacking / growth if growth > 0 else 0.0
    share = min(max(density.grown * (1 - missing), BEGIN[0]), BEGIN[1])
    latest = max(density.grown * steps - TURNS * density.interval, 0)
    return round(min(share * steps, latest)) // density.interval * density.interval


def growing(settings: Settings, shapes: int, begin: int) -> Settings:
    """``settings`` whose schedule has so many ``shapes`` at the step ``begin``, and then grows as before."""
    density = settings.density
    left = 1 - begin / (density.grown * settings.iterations)
    share = elementary.power(shapes / (density.surplus * settings.curves), 1 / left)
    start = density.surplus * float(share)
    low, high = limits_of(Density, "start")
    return replace(settings, density=replace(density, start=min(max(start, low), high)))
