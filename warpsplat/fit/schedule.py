"""Schedules over a run: image sizes, number of shapes and points, thresholds."""

from __future__ import annotations

import math
from dataclasses import dataclass

from warpsplat.fit.settings import Density, Settings
from warpsplat.portable import elementary

TRAINING_SLACK = 2.0
"""``Phase.slack`` of a run: saves a fifth of the edges; a viewer rounds by 0.08 px as well."""

CHECK_INTERVAL = 10
"""Steps between two reads of the loss and of the device's counters."""

EVALUATE_FROM, EVALUATE_INTERVAL = 0.75, 50
"""Share of the run after which the file is evaluated as a viewer shows it, and steps in between."""


@dataclass(frozen=True)
class Phase:
    """Consecutive steps at one image size."""

    width: int
    height: int
    slack: float = TRAINING_SLACK
    """Tolerance of the polylines that stand for curves, over that of the file."""


def phases(settings: Settings, width: int, height: int) -> list[Phase]:
    """Return the coarse and, from ``settings.coarse`` of the run on, the fine phase; one if they agree."""
    coarse = _reduced_size(width, height, settings.coarse_pixels)
    fine = _reduced_size(width, height, settings.fine_pixels)
    return [Phase(*fine)] if coarse == fine else [Phase(*coarse), Phase(*fine)]


def _reduced_size(width: int, height: int, pixels: int) -> tuple[int, int]:
    """Return the size of an image reduced to about ``pixels``.

    One scale serves both sides, so of several lengths of the shorter side the one is taken for which the
    longer one is nearest to a whole number; of equally near ones the largest.
    """
    if pixels >= width * height:
        return width, height
    short, long = min(width, height), max(width, height)
    most = max(1, round(short * math.sqrt(pixels / (width * height))))
    size_choices = 12  # lengths of the shorter side that are tried for a reduced image
    choices = range(most, max(0, most - size_choices), -1)
    best = min(choices, key=lambda n: round(abs(long * n / short - round(long * n / short)), 2))
    other = round(long * best / short)
    return (best, other) if width <= height else (other, best)


def phase_at(settings: Settings, plan: list[Phase], step: int) -> Phase:
    """Return the phase of the step after ``step`` steps."""
    return plan[0] if step < settings.coarse * settings.iterations else plan[-1]


def work_done(settings: Settings, plan: list[Phase], step: int, begin: int = 0) -> float:
    """Return the share of a fit's work that is done after ``step`` steps, if it began at the step ``begin``.

    A step counts by the side length of its image: its time grows about with the outlines, not the areas.
    """
    change = settings.coarse * settings.iterations if len(plan) > 1 else 0.0
    coarse, fine = (math.sqrt(phase.width * phase.height) for phase in (plan[0], plan[-1]))

    def work(until: float) -> float:
        return coarse * min(until, change) + fine * max(until - change, 0.0)

    return (work(step) - work(begin)) / (work(settings.iterations) - work(begin))


def opacity_threshold(density: Density, progress: float) -> float:
    """Return the opacity below which shapes are pruned after ``progress`` (share of the run)."""
    t = min(progress / density.stop, 1.0) if density.stop > 0 else 1.0
    return density.opacity_start + t * (density.opacity_end - density.opacity_start)


def shapes_at(settings: Settings, step: int) -> int:
    """Return the number of shapes after the densification step at ``step``; at 0, the number to start with.

    It grows to a surplus until ``density.grown`` and falls from ``density.thin`` on; after the last
    densification step it is ``settings.curves`` in any case.
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
    """Return whether the densification step at ``step`` searches for gradients; the last one does."""
    density = settings.density
    if step + density.interval >= density.stop * settings.iterations:
        return True
    # Share of the run between two searches for gradients, which take as long as several steps.
    repaint_share = 0.1
    share = repaint_share * settings.iterations
    return step // share > (step - density.interval) // share


def mean_points_at(settings: Settings, step: int) -> float:
    """Return the mean number of points of splines after the densification step at ``step``.

    It is that of new splines until all shapes exist, then falls to ``density.mean_points``.
    """
    density, steps = settings.density, settings.iterations
    last = min(density.stop, 1.0) * steps - density.interval
    first = density.grown * steps
    done = min(max((step - first) / max(last - first, 1.0), 0.0), 1.0)
    return settings.spline_points + done * (density.mean_points - settings.spline_points)
