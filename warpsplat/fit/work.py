"""The progress of a run, as it is told to people and programs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from warpsplat.fit.state import Past
from warpsplat.scene import FloatArray, Scene


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
    after the last step, as measuring the file, is a part of it. On the way to a goal it may fall, where more
    rounds follow than was thought.
    """
    fine: bool
    """Whether the size is the finest: on a reduced image the same shapes have more decibels."""
    shapes: int = 0
    """That there are now."""
    snapshot: Snapshot | None = field(default=None, repr=False, compare=False)
    """What there is now: to be used while the report is heard, and None in a run's history."""


class TimeLeft:
    """What the rest of a run takes if work goes on as it did since the first report.

    What was before, as kernels being compiled, says nothing of the rest.
    """

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None

    def update(self, work: float, now: float) -> float | None:
        """Take note of a share of the work at a time ``now`` [s]: the seconds; None at the very start."""
        self._first = self._first or (now, work)
        began, before = self._first
        done = work - before
        return (now - began) / done * (1 - work) if done > 0 else None


Report = Callable[[Progress], None]

Expected = float | Callable[[Progress], float]
"""A number, or what a report lets expect."""


def expected(value: Expected, now: Progress) -> float:
    """The number, at a report."""
    return value(now) if callable(value) else value


class Meter:
    """The progress of work that is done in stages, some of which only show on the way (``fit.costs``)."""

    def __init__(self, report: Report | None, after: float = 0.0) -> None:
        """``after``: what is to be done once all stages are over."""
        self._report, self._after = report, after
        self._done = 0.0
        self._now = 0.0
        """What the stage that goes on has cost: all of it where it tells nothing."""
        self._started = time.monotonic()

    def stage(self, cost: float, rest: Expected, *, likely: Expected = 1.0) -> Report | None:
        """What the next stage reports to. The stages before it are over: one that ended early has cost what
        its last report said, so that it does not make the pace seem faster than it was.

        Args:
            cost: of all of it.
            rest: what is to be done then, as far as is known.
            likely: share of what is left of it that is done in the mean: it may end early.
        """
        self._done, self._now = self._done + self._now, cost
        if self._report is None:
            return None
        report, before, started = self._report, self._done, self._started

        def told(now: Progress) -> None:
            self._now = cost * now.work
            own = expected(likely, now) * (cost - self._now)
            later = own + expected(rest, now) + self._after
            done = before + self._now
            report(replace(now, work=done / (done + later), seconds=time.monotonic() - started))

        return told
