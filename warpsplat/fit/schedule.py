"""What happens when: image sizes, number of shapes, thresholds, turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

from warpsplat.fit.settings import Density, Settings
from warpsplat.portable import elementary

SIZE_CHOICES = 12
"""How many lengths of the shorter side are tried for a reduced image."""

SLACK = 2.0
"""``Phase.slack`` of a run: a fifth fewer edges, and 0.08 px cost no more than what a viewer rounds."""

CHECK_INTERVAL = 10
"""Steps between two looks at the loss and the counters of the device."""

LOOK_FROM = 0.75
"""Fraction of a run from which on the file is looked at."""

LOOK_INTERVAL = 50
"""Steps between two looks at the file as a viewer shows it."""

REPAINT_SHARE = 0.1
"""Of a run, from one look for gradients to the next: a look takes as long as several steps."""


@dataclass(frozen=True)
class Phase:
    """A stretch of steps at one image size."""

    width: int
    height: int
    slack: float = SLACK
    """How much further from the curves their polylines may be than in the file."""


def phases(settings: Settings, width: int, height: int) -> list[Phase]:
    """Coarse, then fine, from ``settings.coarse`` of the iterations on; one where both are the same size."""

    def fit(pixels: int) -> tuple[int, int]:
        if pixels >= width * height:
            return width, height
        # One scale serves both sides, so that of the sizes a little smaller the one is taken where the longer
        # side is the nearest to a whole number: the largest of those that are equally near.
        short, long = min(width, height), max(width, height)
        most = max(1, round(short * math.sqrt(pixels / (width * height))))
        choices = range(most, max(0, most - SIZE_CHOICES), -1)
        best = min(choices, key=lambda n: round(abs(long * n / short - round(long * n / short)), 2))
        other = round(long * best / short)
        return (best, other) if width <= height else (other, best)

    coarse, fine = fit(settings.coarse_pixels), fit(settings.fine_pixels)
    return [Phase(*fine)] if coarse == fine else [Phase(*coarse), Phase(*fine)]


def phase_at(settings: Settings, plan: list[Phase], step: int) -> Phase:
    """The phase that the step after ``step`` steps belongs to."""
    return plan[0] if step < settings.coarse * settings.iterations else plan[-1]


def opacity_threshold(density: Density, progress: float) -> float:
    """Falls linearly with ``progress`` (fraction of the run) until the set of shapes is fixed."""
    t = min(progress / density.stop, 1.0) if density.stop > 0 else 1.0
    return density.opacity_start + t * (density.opacity_end - density.opacity_start)


def shapes_at(settings: Settings, step: int) -> int:
    """Shapes that a run should have after the turn at ``step``; at 0, those to start with.

    All of them from ``grown`` on, and at the last turn in any case.
    """
    density, steps = settings.density, settings.iterations
    if density.interval <= 0 or step + density.interval >= min(density.stop, 1.0) * steps:
        return settings.curves
    most = density.surplus * settings.curves
    if step > density.thin * steps:
        done = (step - density.thin * steps) / ((density.stop - density.thin) * steps - density.interval)
        return round(most * float(elementary.power(density.surplus, -min(done, 1.0))))
    missing = 1.0 - step / (density.grown * steps) if density.grown > 0 else 0.0
    share = elementary.power(density.start / density.surplus, max(missing, 0.0))
    return max(1, round(most * float(share)))


def repaints_at(settings: Settings, step: int) -> bool:
    """Whether the turn at ``step`` looks for gradients: one each REPAINT_SHARE of the run, and the last."""
    density = settings.density
    if step + density.interval >= density.stop * settings.iterations:
        return True
    share = REPAINT_SHARE * settings.iterations
    return step // share > (step - density.interval) // share


def mean_points_at(settings: Settings, step: int) -> float:
    """Points that splines should have in the mean after the turn at ``step``: those of a new one until all
    shapes are there, then fewer, down to ``density.mean_points`` at the last turn.
    """
    density, steps = settings.density, settings.iterations
    last = min(density.stop, 1.0) * steps - density.interval
    first = density.grown * steps
    done = min(max((step - first) / max(last - first, 1.0), 0.0), 1.0)
    return settings.spline_points + done * (density.mean_points - settings.spline_points)
