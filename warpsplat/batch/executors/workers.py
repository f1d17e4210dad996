"""The scheduler of executors with workers: processes of this machine, or actors of a cluster."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Generic, Protocol, TypeVar

from warpsplat.batch.executors.tasks import Executor, OnProgress, Outcome, Stop, Task
from warpsplat.errors import ResourceError, printable

log = logging.getLogger("warpsplat")

GRACE = 60.0
"""Seconds that tasks have to end after they are asked to: to compile kernels, for a step, and for the file.
A second signal does not wait."""


class TaskWorker(Protocol):
    """A worker as its parent sees it."""

    task: Task | None
    responded: bool
    """Whether it ever sent a message."""

    def give(self, task: Task) -> None:
        """Hand it a task."""

    def stop(self) -> None:
        """Have its task end with the best so far, or at once if there is nothing to save yet."""

    def end(self) -> None:
        """End it at once."""


AnyWorker = TypeVar("AnyWorker", bound=TaskWorker)


class WorkerExecutor(Executor, Generic[AnyWorker]):
    """Does tasks in workers, which are kept, each with one task at a time."""

    tries: int
    """Tries of a task whose worker is lost."""
    stillborn: str
    """Message for workers that never respond."""

    def __init__(self) -> None:
        self._workers: list[AnyWorker] = []
        self._losses: Counter[int] = Counter()
        self._stillborn = 0
        self._stopping = False
        self._waiting: Iterator[Task] | None = None
        """Tasks that were not taken yet; None: all were."""
        self._again: list[Task] = []

    def __exit__(self, *error: object) -> None:
        self._remove(self._workers)

    def run(self, tasks: Iterable[Task], stop: Stop, on_progress: OnProgress) -> Iterator[Outcome]:
        """See ``Executor``."""
        self._waiting, self._again, self._stopping = iter(tasks), [], False
        self._losses.clear()
        while not stop():
            self._give()
            if not self._waiting and not self._again and not self._busy():
                return
            yield from self._receive(on_progress)
        self._stopping = True
        for worker in self._busy():
            worker.stop()
        deadline = time.monotonic() + GRACE
        while self._busy() and time.monotonic() < deadline:
            yield from self._receive(on_progress)
        for task in [*self._again, *(worker.task for worker in self._busy() if worker.task)]:
            yield Outcome(task.number, "stopped")
        self._remove(self._busy())

    def _busy(self) -> list[AnyWorker]:
        return [worker for worker in self._workers if worker.task]

    def _give(self) -> None:
        """Hand tasks to workers while there are places for them."""
        while self._again or self._has_place():
            task = self._again.pop() if self._again else next(self._waiting or iter(()), None)
            if task is None:
                self._waiting = None
                return
            worker = self._worker_for(task)
            if worker is None:
                self._again.append(task)
                return
            worker.give(task)

    def _has_place(self) -> bool:
        """Return whether a further task may be taken."""
        raise NotImplementedError

    def _worker_for(self, task: Task) -> AnyWorker | None:
        """Return an idle worker, perhaps a new one; None if none is ready yet."""
        raise NotImplementedError

    def _receive(self, on_progress: OnProgress) -> Iterator[Outcome]:
        """Handle what workers send, after a short wait for it, and yield the outcomes."""
        raise NotImplementedError

    def _remove(self, workers: list[AnyWorker]) -> None:
        for worker in list(workers):
            worker.end()
            self._workers.remove(worker)

    def _lost(self, worker: AnyWorker, cause: str) -> Outcome | None:
        """Remove a dead worker; keep its task for another try, or return its failure after the last one.

        Raises ``ResourceError`` if too many workers died before they responded.
        """
        self._remove([worker])
        self._stillborn = 0 if worker.responded else self._stillborn + 1
        # After so many workers in a row that are lost before they respond, no more are started.
        most_stillborn = 3
        if self._stillborn >= most_stillborn:
            raise ResourceError(f"{self.stillborn}; the last {cause}")
        task = worker.task
        if task and not self._stopping:
            self._losses[task.number] += 1
            count = self._losses[task.number]
            error = f"{printable(task.name)}: its worker {cause} (try {count} of {self.tries})"
            if count >= self.tries:
                return Outcome(task.number, "failed", error=error)
            log.warning("%s", error)
        if task:
            self._again.append(task)
        return None
