"""Live view of a run: its progress and, now and then, a picture of its shapes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from warpsplat.fit.progress import Progress, TimeLeft
from warpsplat.run.result import Result
from warpsplat.run.svg import save_svg

SHARE = 0.07
"""Largest share of a run's time for its pictures: all in all a page costs less than a tenth."""

LEAST_PAUSE = 0.4
"""Shortest pause between two pictures [s]."""


class LiveRun:
    """The callback of a run. The worker's thread writes, others read: each field is replaced as a whole."""

    def __init__(
        self,
        is_watched: Callable[[], bool] = lambda: True,
        on_change: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start without progress.

        Args:
            is_watched: tells whether a page is open; otherwise no pictures are made.
            on_change: called when there is something new.
            clock: returns the time [s].
        """
        self._is_watched, self._on_change, self._clock = is_watched, on_change, clock
        self._next_picture = -math.inf
        self._least: dict[bool, float] = {}
        """PSNR of the draft on a reduced image and on a fine one [dB]: what is worse is not shown."""
        self.picture = b""
        """The shapes, as an SVG."""
        self.number = 0
        """Pictures so far."""
        self.begin()

    def begin(self, *, is_draft: bool = False) -> None:
        """Start the clock and the progress: of the draft, or of the run proper. Pictures stay."""
        self.is_draft = is_draft
        self._time, self._started = TimeLeft(), self._clock()
        self.progress: Progress | None = None
        self.left: float | None = None
        """Estimated time left [s]."""
        self.note = ""
        """Latest notice of the library, for example that kernels are being compiled."""

    def show_draft(self, draft: Result) -> None:
        """Show a draft until the run is as good."""
        self._least = {progress.fine: progress.psnr for progress in draft.history}
        self._take(draft.svg.encode())

    def __call__(self, progress: Progress) -> None:
        """Take the progress, and a picture if there is time for one."""
        now = self._clock()
        self.left = self._time.update(progress.work, now)
        self.note = ""
        self.progress = replace(progress, snapshot=None)  # a snapshot keeps the arrays of a run
        is_due = now >= self._next_picture and progress.psnr >= self._least.get(progress.fine, -math.inf)
        if progress.snapshot and is_due and self._is_watched():
            self._take(save_svg(progress.snapshot.scene()).encode())
            done = self._clock()
            self._next_picture = done + max(LEAST_PAUSE, (done - now) * (1 / SHARE - 1))
        self._on_change()

    def _take(self, picture: bytes) -> None:
        self.picture = picture
        self.number += 1
        self._on_change()

    def notify(self, text: str) -> None:
        """Show a notice of the library."""
        self.note = text
        self._on_change()

    def as_dict(self) -> dict[str, Any]:
        """Return the state for JSON."""
        seconds = round(self._clock() - self._started, 1)
        if self.progress is None:
            told = {"work": 0.0, "note": self.note, "seconds": seconds}
            return told | {"draft": self.is_draft, "pictures": self.number}
        psnr = self.progress.psnr
        return {
            "work": round(self.progress.work, 4),
            "psnr": round(psnr, 2) if math.isfinite(psnr) else None,
            "fine": self.progress.fine,
            "shapes": self.progress.shapes,
            "seconds": seconds,
            "left": None if self.left is None else round(self.left, 1),
            "pictures": self.number,
            "note": self.note,
            "draft": self.is_draft,
        }
