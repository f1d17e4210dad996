"""The state of a run for checkpoints: the results of its finished fits, and the state of the next one.

A run consists of one fit or several in a row (``search``, ``fit.layered``). A resumed run repeats the same
sequence: it takes the results of the fits that were finished, and continues the next one from its state.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

from warpsplat.errors import CheckpointError
from warpsplat.scene.arrays import Array

SAVE_INTERVAL = 30.0
"""Default time from one save to the next [s]."""

LEAST_SAVE_RATIO = 100.0
"""Least time from one save to the next over the duration of a save: saving costs a hundredth."""

MOST_FITS = 1000
"""Most fits of a run."""


class Content(NamedTuple):
    """Numbers and arrays by name."""

    numbers: dict[str, Any]
    """Values of JSON's types."""
    arrays: dict[str, Array]


class Checkpoint:
    """The fits of a run so far, from which it can be resumed."""

    def __init__(
        self,
        name: str,
        write: Callable[[Content], None],
        every: float = SAVE_INTERVAL,
        saved: Content | None = None,
    ) -> None:
        """Begin a new run, or resume ``saved``; raise ``CheckpointError`` if that is damaged.

        ``name`` is that of the file, for messages; ``write`` saves the state, ``every`` so many seconds.
        """
        self._name, self._write, self._every = name, write, every
        self._results: list[Content] = []
        self._state: Content | None = None
        if saved:
            with self.reading():
                self._results, self._state = _split(saved)
        self._number = -1
        self._due = time.monotonic() + every
        self._is_saved = saved is not None

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to resume from."""
        return not self._results and self._state is None

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Turn errors about saved content into a ``CheckpointError``."""
        try:
            yield
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError) as error:
            raise CheckpointError(f"{self._name}: the checkpoint is damaged: {error}") from error

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
        self._write(_joined(self._results, self._state))
        self._is_saved = True
        now = time.monotonic()
        self._due = now + max(self._every, LEAST_SAVE_RATIO * (now - began))


def number(
    numbers: Mapping[str, Any], name: str, kind: type, low: float = -math.inf, high: float = math.inf
) -> Any:
    """Return a number of a type by its name; raise ``ValueError`` if it is missing, or out of range."""
    value: Any = numbers[name]
    is_of_kind = type(value) is kind  # True is an int, but no number
    if not (is_of_kind and low <= value <= high):
        raise ValueError(f"{name} is no {kind.__name__} in its range")
    return value


def _joined(results: list[Content], state: Content | None) -> Content:
    """Return all parts as one: names of arrays begin with the number of their fit."""
    parts = [*results, state] if state else results
    arrays = {f"{i}/{name}": array for i, part in enumerate(parts) for name, array in part.arrays.items()}
    return Content({"fits": [part.numbers for part in parts], "under way": state is not None}, arrays)


def _split(content: Content) -> tuple[list[Content], Content | None]:
    """Return the results and the state that ``_joined`` put together."""
    fits = content.numbers.get("fits")
    if not isinstance(fits, list) or len(fits) > MOST_FITS or not all(isinstance(fit, dict) for fit in fits):
        raise ValueError("fits are no list of tables")
    parts = [Content(numbers, {}) for numbers in fits]
    for name, array in content.arrays.items():
        index, _, rest = name.partition("/")
        if not index.isdecimal() or int(index) >= len(parts):
            raise ValueError("an array belongs to no fit")
        parts[int(index)].arrays[rest] = array
    return (parts[:-1], parts[-1]) if number(content.numbers, "under way", bool) and parts else (parts, None)
