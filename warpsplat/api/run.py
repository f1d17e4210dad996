"""What runs have in common: the device, who watches them, where their state is kept."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from warpsplat.errors import UsageError, shown
from warpsplat.fit.texts import parse_duration
from warpsplat.fit.work import Progress
from warpsplat.jobs.checkpoint import CheckpointFile
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.device_lock import device_lock

Callback = Callable[[Progress], bool | None]
"""Called with each report of a run; one that returns True ends it with the shapes as they are."""


class Watch:
    """What a run reports to, and what it asks whether to go on."""

    def __init__(self, callback: Callback | None, stop: Callable[[], bool] | None) -> None:
        self._callback, self._stop, self._enough = callback, stop, False

    def report(self, progress: Progress) -> None:
        """Pass a report on."""
        if self._callback and self._callback(progress) is True:
            self._enough = True

    def stop(self) -> bool:
        """Whether somebody asked for the end."""
        return self._enough or bool(self._stop and self._stop())


def checkpoint_file(
    path: str | os.PathLike[str] | None,
    every: float | str,
    others: tuple[object, ...],
    *,
    resume: bool,
    overwrite: bool,
) -> CheckpointFile | None:
    """Where a run keeps its state, which is none of the ``others`` that are paths.

    Raises:
        UsageError: it is one of them, or there is nothing to resume from.
    """
    if path is None:
        if resume:
            raise UsageError("to resume, a run needs a checkpoint")
        return None
    made = CheckpointFile(Path(path), resume, overwrite, parse_duration(every))
    made.check(*(Path(other) for other in others if isinstance(other, (str, os.PathLike))))
    return made


@contextmanager
def backend_on(device: str, threads: int | None) -> Iterator[Backend]:
    """The backend of a piece of work, with the right to use it.

    Raises:
        UsageError: no such device, or number of threads.
    """
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int) or threads < 1):
        raise UsageError(f"threads must be a whole number from 1, not {shown(threads)}")
    start_warp()
    backend = Backend.on(choose_device(device), threads)
    with device_lock(backend.device):
        yield backend
