"""Do one task after the other, in this process."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType

from warpsplat.batch.executors.tasks import Advance, Outcome, Stop, Task
from warpsplat.batch.executors.work import do
from warpsplat.fit.progress import Progress


class Serial:
    """An ``Executor`` in this process."""

    workers = 1

    def __init__(
        self, around: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext
    ) -> None:
        """``around``: context manager for each task."""
        self._around = around

    def __enter__(self) -> Serial:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Do nothing."""

    def run(self, tasks: Iterable[Task], stop: Stop, advance: Advance) -> Iterator[Outcome]:
        """See ``Executor``."""
        waiting = iter(tasks)
        while not stop() and (task := next(waiting, None)):
            yield self._done(task, stop, advance)

    def _done(self, task: Task, stop: Stop, advance: Advance) -> Outcome:
        def on_progress(progress: Progress) -> None:
            advance(task.number, progress.work)

        try:
            with self._around():
                return do(task, stop, on_progress)
        except KeyboardInterrupt:
            return Outcome(task.number, "stopped")
