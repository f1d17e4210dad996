"""A process of a Ray cluster that does tasks for ``ray.RayCluster``. Ray itself is not imported here."""

from __future__ import annotations

import os
import platform
import threading
from typing import NamedTuple

from warpsplat._version import __version__
from warpsplat.batch.executors.tasks import Outcome, Task


class Sight(NamedTuple):
    """A file as it is seen by one machine; another one that sees the same, sees the same file."""

    path: str
    size: int
    modified: int
    """Whole seconds: file systems keep more, or less, of it."""

    @staticmethod
    def of(path: str) -> Sight | None:
        """A file as this machine sees it; None if it does not."""
        try:
            found = os.stat(path)
        except OSError:
            return None
        return Sight(path, found.st_size, int(found.st_mtime))


class Actor:
    """Does a task in one thread, and answers in another one meanwhile."""

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._done = 0.0

    def hello(self) -> tuple[str, str]:
        """The version of the package, and the node. Of plain types: another version has to understand it."""
        return __version__, platform.node()

    def do(self, task: Task, sights: tuple[Sight, ...]) -> Outcome | tuple[str, ...]:
        """Do a task.

        Args:
            task: with paths of files that ``sights`` are of.
            sights: files as they are seen where the task comes from.

        Returns:
            what became of it; or nothing was done, and these files are not seen here.
        """
        unseen = tuple(sight.path for sight in sights if Sight.of(sight.path) != sight)
        if unseen:
            return unseen
        from warpsplat.batch.executors.work import do
        from warpsplat.fit.progress import Progress  # in here, as all that is heavy: hello is quick

        self._stop.clear()
        self._done = 0.0

        def on_progress(progress: Progress) -> None:
            self._done = progress.work

        return do(task, self._stop.is_set, on_progress)

    def stop(self) -> None:
        """End the task in work, with the best so far."""
        self._stop.set()

    def done(self) -> float:
        """Which part of the task in work is done."""
        return self._done
