"""Do tasks for ``ray.RayCluster`` in a process of the cluster. Ray itself is not imported here."""

from __future__ import annotations

import os
import platform
import threading
from typing import NamedTuple

from warpsplat._version import __version__
from warpsplat.batch.executors.tasks import Outcome, Task


class Sight(NamedTuple):
    """A file as one machine sees it; a machine with an equal view sees the same file."""

    path: str
    size: int
    modified: int
    """In whole seconds: file systems differ in precision."""

    @staticmethod
    def of(path: str) -> Sight | None:
        """Return a file as this machine sees it; None if it does not."""
        try:
            found = os.stat(path)
        except OSError:
            return None
        return Sight(path, found.st_size, int(found.st_mtime))


class Actor:
    """Does a task in one thread, and answers in another meanwhile."""

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._done = 0.0

    def hello(self) -> tuple[str, str]:
        """Return the version of the package and the node, as plain types that any version understands."""
        return __version__, platform.node()

    def do(self, task: Task, sights: tuple[Sight, ...]) -> Outcome | tuple[str, ...]:
        """Do a task.

        Args:
            task: with the paths of the files of ``sights``.
            sights: files as the task's origin sees them.

        Returns:
            the outcome; or the files that are not seen here, and nothing was done.
        """
        unseen = tuple(sight.path for sight in sights if Sight.of(sight.path) != sight)
        if unseen:
            return unseen
        from warpsplat.batch.executors.work import do
        from warpsplat.fit.progress import Progress  # here, so that hello is quick

        self._stop.clear()
        self._done = 0.0

        def on_progress(progress: Progress) -> None:
            self._done = progress.work

        return do(task, self._stop.is_set, on_progress)

    def stop(self) -> None:
        """End the current task, with the best so far."""
        self._stop.set()

    def done(self) -> float:
        """Return the fraction of the current task that is done."""
        return self._done
