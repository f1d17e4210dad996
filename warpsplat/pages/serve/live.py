"""Show a run in progress: its figures, and its image now and then."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from warpsplat.fit.progress import Progress, Snapshot, TimeLeft
from warpsplat.run.svg import save_svg

SHARE = 0.07
"""Fraction of a run's time for its images; in all, a page costs less than a tenth."""

LEAST_PAUSE = 0.4
"""Minimum time between two images [s]."""


class Live:
    """Callback of a run. The worker's thread writes, others read: each field is replaced as a whole."""

    def __init__(
        self,
        is_watched: Callable[[], bool] = lambda: True,
        changed: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start without any report.

        Args:
            is_watched: whether anybody looks: without, no picture is made.
            changed: called when there is something new to tell.
            clock: [s]
        """
        self._is_watched, self._changed, self._clock = is_watched, changed, clock
        self._time = TimeLeft()
        self._next = -math.inf
        self._started = clock()
        self.progress: Progress | None = None
        self.left: float | None = None
        """[s]"""
        self.picture = b""
        """The shapes as an SVG."""
        self.number = 0
        """Number of images so far."""
        self.note = ""
        """Notice of the library, such as that kernels are being compiled."""

    def begin(self) -> None:
        """Note that the run has started."""
        self._started = self._clock()

    def __call__(self, progress: Progress) -> None:
        """Take a progress report."""
        now = self._clock()
        self.left = self._time.update(progress.work, now)
        self.note = ""
        snapshot = progress.snapshot
        self.progress = replace(progress, snapshot=None)  # which keeps a run's arrays
        if snapshot and now >= self._next and self._is_watched():
            self._draw(snapshot, now)
        self._changed()

    def notify(self, text: str) -> None:
        """Take a notice of the library."""
        self.note = text
        self._changed()

    def _draw(self, snapshot: Snapshot, now: float) -> None:
        """Make an image, and schedule the next one."""
        self.picture = save_svg(snapshot.scene()).encode()
        self.number += 1
        done = self._clock()
        self._next = done + max(LEAST_PAUSE, (done - now) * (1 / SHARE - 1))

    def as_dict(self) -> dict[str, Any]:
        """Return JSON values."""
        seconds = self._clock() - self._started
        if self.progress is None:
            return {"work": 0.0, "note": self.note, "seconds": round(seconds, 1)}
        psnr = self.progress.psnr
        return {
            "work": round(self.progress.work, 4),
            "psnr": round(psnr, 2) if math.isfinite(psnr) else None,
            "fine": self.progress.fine,
            "shapes": self.progress.shapes,
            "seconds": round(seconds, 1),
            "left": None if self.left is None else round(self.left, 1),
            "pictures": self.number,
            "note": self.note,
        }
