"""What a run's parts cost, in units of their own: for progress that goes on evenly, not for results.

A unit is what a step takes on one thread of a CPU for the pixels alone, where there are 100,000 of them: some
milliseconds. Figures were fitted to the processor time of runs of three efforts on photographs of 0.4 and 2.8
million pixels with 128 to 512 shapes: what is left was foreseen within a third from the first tenth on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from warpsplat.fit.schedule import Phase, phases, shapes_at
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import Past
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Kind, Scene


@dataclass(frozen=True)
class Snapshot:
    """The shapes of a run between two steps, which is read from the device when it is asked for."""

    scene: Callable[[], Scene]
    """The shapes, on the canvas of the image that is worked on: smaller than the file's in a run that is
    reduced to stay below a limit of memory.
    """
    image: Callable[[], FloatArray]
    """The render of the step before, sRGB in [0, 1], shape (height, width, 3), or premultiplied with opacity,
    shape (height, width, 4); of the size that the training has come to.
    """
    past: Callable[[], Past] | None = None
    """What the optimizer knows of the shapes, for a fit that goes on from them."""


@dataclass(frozen=True)
class Progress:
    """State of a run between two steps."""

    step: int
    """Steps done."""
    steps: int
    """Steps in all."""
    psnr: float
    """Of the internal render at the current training size [dB]."""
    seconds: float
    """Since the start of the training."""
    work: float
    """Share of the run's work that is done, 0 to 1: a step counts by what its size makes it cost. What comes
    after the last step, as measuring the file, is a part of it.
    """
    fine: bool
    """Whether the size is the finest: on a reduced image the same shapes have more decibels."""
    shapes: int = 0
    """That there are now."""
    snapshot: Snapshot | None = field(default=None, repr=False, compare=False)
    """What there is now: to be used while the report is heard, and None in a run's history."""


Report = Callable[[Progress], None]

PIXELS = 100_000
"""Of the picture whose step costs a unit."""

PIXEL_POWER = 0.6
"""By which a step's cost grows with the pixels: there is more to each of few."""

SHAPE_COST = 0.01
"""Of a shape in a step, at that size; it grows with the picture's side, as outlines do."""

STROKE_COST, SPLAT_COST = 2.5, 4.0
"""Factors of strokes, and of splats."""

EYES_COST, SCORE_COST = 95.0, 20.0
"""Of measuring a file of that size: with SSIMULACRA2 and without."""

GPU_THREADS = 30
"""Threads of a CPU that a GPU's steps are as fast as; files are measured on the CPU all the same."""

PARTS = 24
"""Of a phase, whose costs are looked at: shapes come and go in between."""


def step_cost(settings: Settings, phase: Phase, shapes: float) -> float:
    """Of a step with so many shapes."""
    size = phase.width * phase.height / PIXELS
    factor = STROKE_COST if settings.kind == Kind.STROKE else 1.0
    if settings.renderer != "exact":
        factor = SPLAT_COST
    return factor * (size**PIXEL_POWER + SHAPE_COST * shapes * math.sqrt(size))


def fit_cost(
    settings: Settings, plan: list[Phase], step: float, begin: float = 0, ends: Sequence[int] = ()
) -> float:
    """Of the steps of a run from ``begin`` up to ``step``.

    ``ends``: shapes of earlier levels, which are there as well, and whose pictures are rendered besides.
    """
    change = settings.coarse * settings.iterations if len(plan) > 1 else 0.0
    below = ends[-1] if ends else 0
    total = 0.0
    for phase, first, last in ((plan[0], 0.0, change), (plan[-1], change, float(settings.iterations))):
        start, steps = max(first, begin), min(last, step) - max(first, begin)
        for part in range(PARTS if steps > 0 else 0):
            shapes = below + shapes_at(settings, int(start + (part + 0.5) / PARTS * steps))
            cost = sum(step_cost(settings, phase, count) for count in (shapes, *ends))
            total += steps / PARTS * cost
    return total


def run_cost(
    settings: Settings, width: int, height: int, begin: float = 0, ends: Sequence[int] = ()
) -> float:
    """Of a whole fit to an image of this size."""
    return fit_cost(settings, phases(settings, width, height), settings.iterations, begin, ends)


def score_cost(width: int, height: int, backend: Backend, *, eyes: bool) -> float:
    """Of making and measuring a file, which one thread does."""
    threads = backend.threads if backend.device.is_cpu else GPU_THREADS
    return (EYES_COST if eyes else SCORE_COST) * width * height / PIXELS * threads


class Meter:
    """The progress of work that is done in stages, some of which only show on the way."""

    def __init__(self, report: Report | None, after: float = 0.0) -> None:
        """``after``: what is to be done once all stages are over."""
        self._report, self._after = report, after
        self._done = 0.0
        self._started = time.monotonic()

    def stage(self, cost: float, rest: float) -> Report | None:
        """What the next stage reports to: it costs ``cost``, and then ``rest`` is to be done, as far as is
        known. The stages before it are over.
        """
        report, before, started = self._report, self._done, self._started
        rest += self._after
        self._done += cost
        if report is None:
            return None

        def told(now: Progress) -> None:
            work = (before + cost * now.work) / (before + cost + rest)
            report(replace(now, work=work, seconds=time.monotonic() - started))

        return told
