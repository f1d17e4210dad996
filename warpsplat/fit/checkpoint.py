"""The state of a run for checkpoints: the results of its finished fits, and the state of the next one.

A run consists of one fit or several in a row (``search``, ``fit.layered``). A resumed run repeats the same
sequence: it takes the results of the fits that were finished, and continues the next one from its state.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

SAVE_INTERVAL = 30.0
"""Default time from one save to the next [s]."""

LEAST_SAVE_RATIO = 100.0
"""Least time from one save to the next over the duration of a save: saving costs a hundredth."""

Content = dict[str, Any]
"""JSON's types and arrays by name, as ``files.packed`` writes them."""


class Checkpoint:
    """The fits of a run so far, from which it can be resumed."""

    def __init__(
        self, write: Callable[[Content], None], every: float = SAVE_INTERVAL, saved: Content | None = None
    ) -> None:
        """Begin a new run, or resume ``saved``; ``write`` saves the state, ``every`` so many seconds."""
        self._write, self._every = write, every
        self._results: list[Content] = saved["fits"] if saved else []
        self._state: Content | None = saved["state"] if saved else None
        self._number = -1
        self._due = time.monotonic() + every
        self._is_saved = saved is not None

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to resume from."""
        return not self._results and self._state is None

    def begin(self) -> None:
        """Continue with the next fit."""
        self._number += 1

    @property
    def result(self) -> Content | None:
        """The result of the current fit, if an earlier run finished it."""
        return self._results[self._number] if self._number < len(self._results) else None

    @property
    def state(self) -> Content | None:
        """The state of the current fit, if an earlier run began it."""
        return self._state if self._number == len(self._results) else None

    def keep(self, state: Callable[[], Content], *, now: bool) -> None:
        """Save the state of the current fit if it is time, or ``now``."""
        if now or time.monotonic() >= self._due:
            self._state, self._is_saved = state(), False
            self.save()

    def finish(self, result: Content) -> None:
        """Keep the result of the current fit; it is saved with the next state, or when the run ends."""
        self._results.append(result)
        self._state, self._is_saved = None, False

    def save(self) -> None:
        """Save the state, if it is new."""
        if self._is_saved:
            return
        began = time.monotonic()
        self._write({"fits": self._results, "state": self._state})
        self._is_saved = True
        now = time.monotonic()
        self._due = now + max(self._every, LEAST_SAVE_RATIO * (now - began))
