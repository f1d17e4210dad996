"""Fits to one image with ascending numbers of shapes, each continued from the one before.

A fit grows to a surplus of shapes, trains it, and thins it. Before thinning, its shapes and the optimizer's
state are kept: from there the next fit grows on, and leaves out the beginning of its own schedule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warpsplat.fit.options import limits_of
from warpsplat.fit.problem import Run, Start
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import Density, Settings
from warpsplat.fit.state import Past
from warpsplat.portable import elementary
from warpsplat.scene import Scene

BEGIN = 0.25, 0.375
"""Least and largest share of its schedule that a continued fit leaves out: in between, it begins where its
schedule has as many shapes as it starts with (docs/experiments.md).
"""


class Series:
    """Fits of ascending numbers of shapes, one after the other."""

    def __init__(self, settings: Settings, numbers: Sequence[int], *, shares: bool = True) -> None:
        """Begin a series of fits of these ``numbers`` of shapes, all else by ``settings``.

        ``shares``: whether fits continue from one another.
        """
        self._settings, self._shares = settings, shares
        self._numbers = sorted(numbers)
        self._kept: tuple[Scene, Past] | None = None

    def next(self, number: int) -> tuple[Settings, Start | None]:
        """Return the settings and start of the fit with ``number`` shapes, more than those before it."""
        settings = replace(self._settings, curves=number)
        if self._kept is None:
            return settings, None
        scene, past = self._kept
        begin = begin_of(settings, len(scene))
        if begin == 0:
            return settings, None
        return growing(settings, len(scene), begin), Start(scene, past, begin)

    def part(self, number: int, run: Run) -> Run:
        """Return the run of the fit with ``number`` shapes, which keeps what the next one starts from."""
        full = self._settings.density.thin * self._settings.iterations
        waits = self._shares and number != self._numbers[-1]

        def keep(now: Progress) -> Progress:
            nonlocal waits
            if waits and now.step >= full and now.snapshot and now.snapshot.past:
                self._kept, waits = (now.snapshot.scene(), now.snapshot.past()), False
            return now

        before, whole = sum(other for other in self._numbers if other < number), sum(self._numbers)
        return run.part(before / whole, (before + number) / whole).mapped(keep)


def begin_of(settings: Settings, shapes: int) -> int:
    """Return the step at which a fit continues from ``shapes``; 0 if it starts with new ones."""
    density, steps = settings.density, settings.iterations
    if density.interval <= 0:
        return 0
    growth = float(elementary.log(density.surplus / density.start))
    missing_log = float(elementary.log(density.surplus * settings.curves / shapes))
    missing = missing_log / growth if growth > 0 else 0.0
    share = min(max(density.grown * (1 - missing), BEGIN[0]), BEGIN[1])
    # Fewest densification steps in which the shapes of a continued fit grow: many at a time find bad places.
    # Fits of few steps have fewer, and start with new shapes.
    least_growth_steps = 5
    latest = max(density.grown * steps - least_growth_steps * density.interval, 0)
    return round(min(share * steps, latest)) // density.interval * density.interval


def growing(settings: Settings, shapes: int, begin: int) -> Settings:
    """Return ``settings`` whose schedule has ``shapes`` at the step ``begin``, and then grows as before."""
    density = settings.density
    left = 1 - begin / (density.grown * settings.iterations)
    share = elementary.power(shapes / (density.surplus * settings.curves), 1 / left)
    start = density.surplus * float(share)
    low, high = limits_of(Density, "start")
    return replace(settings, density=replace(density, start=min(max(start, low), high)))
