"""Do tasks in this process, and decide how many processes and threads a batch uses on this machine."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator

from warpsplat.batch.executors.tasks import Executor, OnProgress, Outcome, Stop, Task
from warpsplat.batch.executors.work import do
from warpsplat.fit.settings import Settings
from warpsplat.native import available_cores, free_memory

MEMORY = 1 << 30
"""Memory per process [bytes]: for an image of 10 million pixels."""


def split_cores(
    settings: Iterable[Settings], workers: int | None, threads: int | None, *, on_cpu: bool
) -> tuple[int, int | None]:
    """Return the number of processes, and of threads for each; both may be given (not None).

    One process per core with one thread each does more than one process with all threads, since reading,
    scoring, writing and densification are not split among threads. On a GPU they would share the one device.
    """
    cores = available_cores()
    # Shapes times steps of a batch from which processes save more than the seconds that they take to start.
    worthwhile = 400_000
    if workers is None:
        efforts = [one.curves * one.iterations for one in settings]
        workers = 1
        if on_cpu and sum(efforts) >= worthwhile:
            free = free_memory()
            capacity = cores if free is None else free // MEMORY
            workers = max(1, min(cores // (threads or 1), len(efforts), capacity))
    return workers, threads if threads or not on_cpu else max(1, cores // workers)


class Serial(Executor):
    """Does one task after the other in this process."""

    def __init__(
        self, around: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext
    ) -> None:
        """``around``: returns a context manager for each task."""
        self._around = around

    def run(self, tasks: Iterable[Task], stop: Stop, on_progress: OnProgress) -> Iterator[Outcome]:
        """See ``Executor``."""
        waiting = iter(tasks)
        while not stop() and (task := next(waiting, None)):
            try:
                with self._around():
                    outcome = do(task, stop, on_progress)
            except KeyboardInterrupt:
                outcome = Outcome(task.number, "stopped")
            yield outcome
