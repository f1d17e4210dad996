"""Preview a run on a terminal: redrawn during training, and at the end beside its source."""

from __future__ import annotations

import contextlib
import math
import secrets
import time
from collections.abc import Callable
from typing import IO

from warpsplat.fit.progress import Progress
from warpsplat.motion.terminal.detect import Terminal
from warpsplat.motion.terminal.layout import Place, beside, drawing, joined, place, resized
from warpsplat.scene import FloatArray

SHARE = 0.05
"""Fraction of a run's time to spend on drawing."""

SOONEST = 0.1
"""Minimum time between two drawings [s]."""

FIRST_WAIT = 1.0
"""Maximum time from the first drawing to the second [s], as the first one is slow."""

SAVE, RESTORE = "\x1b7", "\x1b8"
"""Save and restore the cursor."""


class Preview:
    """Draws on a stream. While a run goes on the picture is above the line that the cursor is in, a progress
    bar's, and stays there; what is written of a line is left as it is.
    """

    def __init__(
        self,
        stream: IO[str],
        look: Callable[[], Terminal],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        """``look``: returns the terminal as it is now."""
        self._stream, self._look, self._clock = stream, look, clock
        self._terminal: Terminal | None = None
        self._place: Place | None = None
        """Layout of the current image, if any."""
        self._next, self._cost = 0.0, math.inf
        self._name = 1 + secrets.randbelow(2**24 - 1)

    def report(self, progress: Progress) -> None:
        """Draw the image of a progress report, unless the last drawing was too recent."""
        begun = self._clock()
        if progress.snapshot is None or begun < self._next:
            return
        terminal = self._look()
        if terminal.live:
            self._draw(progress.snapshot.image(), None, terminal, quick=True)
        now = self._clock()
        before, self._cost = self._cost, now - begun
        wait = min(before, self._cost) * (1 / SHARE - 1)  # one that was held up says nothing of the next one
        self._next = now + max(SOONEST, wait if before < math.inf else min(wait, FIRST_WAIT))

    def move_on(self) -> None:
        """Keep the current image and draw the next one below, as lines were printed in between."""
        self._place = None

    def finish(self, image: FloatArray, source: FloatArray | None) -> None:
        """Draw the finished image in place of the last one, with its source beside it if there is room.

        Pictures have values in [0, 1] and shapes (height, width, 3), or (height, width, 4) premultiplied.
        """
        self._draw(image, source, self._look())

    def _draw(
        self, image: FloatArray, source: FloatArray | None, terminal: Terminal, *, quick: bool = False
    ) -> None:
        if terminal != self._terminal:  # another size: where the picture was nobody knows
            self._terminal, self._place = terminal, None
        one = place(terminal, image.shape[1], image.shape[0])
        if one is None:
            return
        pixels = resized(image, one.pixels)
        if source is not None and beside(terminal, one):
            pixels = joined(resized(source, one.pixels), pixels, one)
        text = drawing(terminal, pixels, one, self._name, quick=quick)
        if not terminal.live:
            self._write(text + "\n")
            return
        begin = ""
        if self._place is None or self._place.rows != one.rows:
            begin = "\r\x1b[2K" + one.rows * "\n"
            self._place = one
        self._write(f"{begin}{SAVE}\r\x1b[{one.rows}A{text}{RESTORE}")

    def _write(self, text: str) -> None:
        """Write; errors of the stream are ignored."""
        with contextlib.suppress(OSError, ValueError):
            self._stream.write(text)
            self._stream.flush()
