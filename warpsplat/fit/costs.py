"""What a run's parts cost, for progress that goes on evenly, not for results.

In milliseconds of one thread of the processor that they were measured on: a bar learns how fast its own
machine is, so that only proportions matter. Fitted to the processor time of runs of all efforts, kinds of
shapes and goals, on images of 0.1 to 3.4 million pixels with 4 to 770 shapes.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.rounding import STAGES, stage_steps
from warpsplat.fit.schedule import EVALUATE_FROM, EVALUATE_INTERVAL, Phase, phases, shapes_at
from warpsplat.fit.settings import Settings
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Kind

PIXELS = 100_000
"""What sizes are counted in."""


@dataclass(frozen=True)
class Law:
    """Of a step: what ``PIXELS`` cost and what shapes on them do, and the powers of the size in that."""

    pixels: float
    pixel_power: float
    shapes: float
    shape_power: float
    number_power: float = 1.0
    """By which what shapes cost grows with their number: many are small."""

    def cost(self, size: float, shapes: float) -> float:
        """Of a step with so many shapes."""
        number = shapes**self.number_power
        return self.pixels * size**self.pixel_power + self.shapes * number * size**self.shape_power


FILLS = Law(0.34, 0.66, 0.235, 0.49, 0.656)
STROKES = Law(20.0, 0.64, 0.033, 0.69)

TURN, TURN_PIXELS, TURN_SHAPE = 8.0, 15.0, 0.115
"""Of surgery: of each turn, of ``PIXELS``, of a shape."""

TURN_PAINTED = 2.5
"""Factor of it where gradients are looked for."""

FILE, FILE_PIXELS, FILE_SHAPE = 8.0, 25.0, 0.38
"""Of making and measuring a file, or of a look at it: of each, of ``PIXELS``, of a shape."""

EYES, EYES_PIXELS, EYES_SHAPE = 200.0, 150.0, 0.5
"""Of making a file and measuring it with SSIMULACRA2 as well."""

GRID, GRID_SHAPE, GRID_SHAPE_THRIFTY = 30.0, 0.22, 0.95
"""Of choosing the grid of a file: of each, of a shape, and of one whose bytes are weighed as well ..."""

GRID_OTHERS = 3.0
"""... and factor of a shape's, where steps are not those of fills."""

GPU_THREADS = 30
"""Threads of a CPU that a GPU's steps are as fast as; the rest is done on the CPU all the same."""

PARTS = 24
"""Of a phase, whose costs are looked at: shapes come and go in between. Of surgery twice as many."""


def law_of(settings: Settings) -> Law:
    """Of the steps of a run."""
    if cost := renderer_of(settings.renderer).step_cost:
        return Law(*cost)
    return STROKES if settings.kind == Kind.STROKE else FILLS


def serial(backend: Backend) -> int:
    """How much more something counts that one thread does, where steps have more of them."""
    return backend.threads if backend.device.is_cpu else GPU_THREADS


@dataclass(frozen=True)
class Course:
    """A fit, as far as its cost goes."""

    settings: Settings
    plan: list[Phase]
    begin: int = 0
    """Step to start at."""
    ends: Sequence[int] = ()
    """Shapes of earlier levels, which are there as well, and whose pictures are rendered besides."""
    finish: bool = True
    """Whether a file is made of the result, for which it is looked at and rounded."""
    thrifty: bool = False
    """Whether the grid is chosen by the bytes of the file as well."""
    serial: int = 1
    """See ``serial``."""

    @staticmethod
    def of(settings: Settings, width: int, height: int, backend: Backend, **more: Any) -> Course:
        """A whole fit to an image of this size, but for what ``more`` says."""
        return Course(settings, phases(settings, width, height), serial=serial(backend), **more)

    def cost(self, step: float | None = None) -> float:
        """Of the steps up to ``step``, and of what comes between them; None: of all."""
        settings, plan = self.settings, self.plan
        until = settings.iterations if step is None else step
        change = settings.coarse * settings.iterations if len(plan) > 1 else 0.0
        stretches = ((plan[0], 0.0, change), (plan[-1], change, float(settings.iterations)))
        total = sum(
            self._stretch(phase, max(first, self.begin), min(last, until)) for phase, first, last in stretches
        )
        total += self._turns(change, until)
        return total + (self._file(change, until) if self.finish else 0.0)

    def _stretch(self, phase: Phase, first: float, last: float) -> float:
        """Of steps and turns at one size."""
        size = phase.width * phase.height / PIXELS
        law, length = law_of(self.settings), max(last - first, 0.0) / PARTS
        total = 0.0
        for part in range(PARTS if length else 0):
            shapes = self._shapes(int(first + (part + 0.5) * length))
            total += length * sum(law.cost(size, count) for count in (shapes, *self.ends))
        return total

    def _shapes(self, step: int) -> int:
        """How many there are after ``step`` steps, those of earlier levels included."""
        below, interval = (self.ends[-1] if self.ends else 0), self.settings.density.interval
        return below + shapes_at(self.settings, step - step % interval if interval else step)

    def _turns(self, change: float, until: float) -> float:
        """Of surgery before the step ``until``, at the size that it is done at: that before ``change`` or
        after. Each turn takes as long as several steps, and is over at once.
        """
        density = self.settings.density
        if not density.interval:
            return 0.0
        first = density.interval * (self.begin // density.interval + 1)
        last = min(until, density.stop * self.settings.iterations)
        turns = range(first, math.ceil(last), density.interval)
        stride = max(1, len(turns) // (2 * PARTS))
        total = 0.0
        for step in turns[::stride]:
            phase = self.plan[0] if step <= change else self.plan[-1]
            total += stride * turn_cost(phase.width * phase.height / PIXELS, self._shapes(step))
        return self.serial * total * (1.0 if self.settings.paint == "flat" else TURN_PAINTED)

    def _file(self, fine: float, until: float) -> float:
        """Of looks at the file from the step ``fine`` on, and of choosing its grid."""
        settings, phase = self.settings, self.plan[-1]
        shapes = settings.curves + (self.ends[-1] if self.ends else 0)
        rounded = settings.iterations - STAGES * stage_steps(settings)
        total = 0.0
        if settings.viewer:
            first = max(fine, EVALUATE_FROM * settings.iterations, self.begin)
            looks = _multiples(first, min(until, rounded), EVALUATE_INTERVAL)
            total += looks * file_cost(phase.width * phase.height, shapes)
        if until > rounded:
            factor = 1.0 if law_of(settings) is FILLS else GRID_OTHERS
            total += GRID + factor * (GRID_SHAPE_THRIFTY if self.thrifty else GRID_SHAPE) * shapes
        return self.serial * total


def turn_cost(size: float, shapes: float) -> float:
    """Of surgery, once, with flat paints."""
    return TURN + TURN_PIXELS * size + TURN_SHAPE * shapes


def _multiples(first: float, last: float, interval: int) -> int:
    """How many multiples of ``interval`` there are from ``first`` on and below ``last``."""
    return max(0, math.ceil(last / interval) - math.ceil(first / interval))


def file_cost(pixels: int, shapes: float) -> float:
    """Of making and measuring a file, without SSIMULACRA2."""
    return FILE + FILE_PIXELS * pixels / PIXELS + FILE_SHAPE * shapes


def score_cost(pixels: int, shapes: float, backend: Backend, *, eyes: bool) -> float:
    """What comes after a run: making its file and measuring it."""
    if eyes and importlib.util.find_spec("ssimulacra2"):
        return serial(backend) * (EYES + EYES_PIXELS * pixels / PIXELS + EYES_SHAPE * shapes)
    return serial(backend) * file_cost(pixels, shapes)
