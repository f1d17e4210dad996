"""Progress of a run, for people and programs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from warpsplat.field_docs import described
from warpsplat.scene import FloatArray, Scene

if TYPE_CHECKING:
    from warpsplat.fit.state import Past


@described
@dataclass(frozen=True)
class Snapshot:
    """The shapes of a run between two steps, read from the device when asked for."""

    scene: Callable[[], Scene]
    """The shapes, on the canvas of the image that is worked on: smaller than the file's in a run that is
    reduced to stay below a limit of memory.
    """
    image: Callable[[], FloatArray]
    """The render before the last step, sRGB in [0, 1], shape (height, width, 3), or premultiplied with
    opacity, shape (height, width, 4), at the current training size.
    """
    past: Callable[[], Past] | None = None
    """The optimizer's state, for a fit that continues from these shapes."""


@described
@dataclass(frozen=True)
class Progress:
    """State of a run between two steps."""

    step: int
    """Steps done."""
    steps: int
    """Steps in all."""
    psnr: float
    """PSNR of the internal render at the current training size [dB]."""
    seconds: float
    """Since the run began."""
    work: float
    """Estimated share of the training that is done, from 0 to 1. It never falls."""
    fine: bool
    """Whether the training has reached its finest size: on a reduced image the same shapes have more
    decibels."""
    shapes: int = 0
    """Current number of shapes."""
    snapshot: Snapshot | None = field(default=None, repr=False, compare=False)
    """The current shapes: valid during the callback only, and None in a run's history."""


Callback = Callable[[Progress], bool | None]
"""Called every few steps of a run. One that returns True ends the run with the shapes as they are."""


class TimeLeft:
    """Estimates the rest of a run from the pace since the first report, which excludes kernel compilation."""

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None

    def update(self, work: float, now: float) -> float | None:
        """Return the seconds left when a share ``work`` is done at time ``now`` [s]; None at the start."""
        self._first = self._first or (now, work)
        began, before = self._first
        done = work - before
        return (now - began) / done * (1 - work) if done > 0 else None
