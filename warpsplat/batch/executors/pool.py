"""Several tasks at the same time, each in a process of its own, which is started once and kept.

Processes are spawned: Warp and its threads do not survive a fork. A process that dies is the end of Python's
own pools; here it costs its task a second try.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import signal
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from multiprocessing.connection import wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from types import TracebackType

from warpsplat.batch.executors.tasks import Advance, Outcome, Stop, Task
from warpsplat.batch.executors.worker import STOP, Notice, Part, main
from warpsplat.errors import ResourceError, printable
from warpsplat.files.output import remove_stale

log = logging.getLogger("warpsplat")

GRACE = 10.0
"""Seconds that a task has to end after the word to stop: a step, and writing the file."""

LOOK = 0.1
"""Seconds between two questions whether to stop."""

TRIES = 2
"""Of a task whose worker dies."""

STILLBORN = 3
"""After so many workers in a row that die before they have done anything, no more are started."""


class Worker:
    """A process, its channel, and the task that it has."""

    def __init__(self, workers: int) -> None:
        """``workers``: how many there are, this one counted."""
        context = multiprocessing.get_context("spawn")
        self.channel, other = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=main,
            args=(other, os.getpid(), log.getEffectiveLevel(), workers),
            name="warpsplat worker",
        )
        with _signals_blocked():
            self.process.start()
        other.close()
        self.task: Task | None = None
        self.begun = False
        """Whether the task has something to save."""
        self.heard = False
        """Whether it ever said anything."""

    def give(self, task: Task) -> None:
        """Hand it a task. Of one that is dead the channel ends, which is heard."""
        self.task, self.begun = task, False
        with contextlib.suppress(OSError):
            self.channel.send(task)

    def listen(self, advance: Advance) -> Outcome | None:
        """Take its next message.

        Raises:
            EOFError, OSError: it is dead.
        """
        message = self.channel.recv()
        self.heard = True
        if isinstance(message, Outcome):
            self.task = None
            return message
        if isinstance(message, Part):
            self.begun = True
            advance(message.number, message.done)
        elif isinstance(message, Notice):
            log.log(message.level, "%s", message.text)
        return None

    def stop(self) -> None:
        """Have its task ended: with the best so far, or, where there is nothing yet, at once."""
        if self.begun:
            with contextlib.suppress(OSError):
                self.channel.send(STOP)
        else:
            self.process.kill()

    def dismiss(self) -> None:
        """Let it end by itself if it has nothing to do, else at once."""
        if self.task:
            self.process.kill()
            return
        with contextlib.suppress(OSError):
            self.channel.send(None)

    def bury(self) -> None:
        """Wait until it has ended, and tidy up after it."""
        self.process.join(GRACE)
        self.process.kill()
        self.process.join()
        self.channel.close()
        if self.task and not self.task.bring:
            remove_stale(Path(self.task.output).parent)


class Pool:
    """An ``Executor``, see there."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._workers: list[Worker] = []
        self._stillborn = 0

    def __enter__(self) -> Pool:
        """Workers start with the first tasks."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """See ``Executor``."""
        for worker in self._workers:
            worker.dismiss()
        for worker in self._workers:
            worker.bury()
        self._workers.clear()

    def run(self, tasks: Iterable[Task], stop: Stop, advance: Advance) -> Iterator[Outcome]:
        """See ``Executor``."""
        waiting, again = iter(tasks), list[Task]()
        lost: Counter[int] = Counter()
        late: float | None = None
        while True:
            if late is None and stop():
                late = time.monotonic() + GRACE
                for worker in self._busy():
                    worker.stop()
            while late is None and len(self._busy()) < self.workers:
                task = again.pop() if again else next(waiting, None)
                if task is None:
                    break
                self._free().give(task)
            if not self._busy():
                return
            if late is not None and time.monotonic() > late:
                for worker in self._busy():
                    worker.process.kill()
            for worker in self._speaking():
                task = worker.task
                try:
                    outcome = worker.listen(advance)
                except (EOFError, OSError):
                    assert task, "only those that have one are listened to"
                    cause = self._bury(worker)
                    lost[task.number] += 1
                    if late is not None:
                        outcome = Outcome(task.number, "stopped")
                    elif lost[task.number] < TRIES:
                        again.append(task)
                        outcome = None
                    else:
                        error = f"{printable(task.name)}: its worker process {cause}, for the second time"
                        outcome = Outcome(task.number, "failed", error=error)
                if outcome:
                    yield outcome

    def _busy(self) -> list[Worker]:
        return [worker for worker in self._workers if worker.task]

    def _speaking(self) -> list[Worker]:
        """The busy ones that have something to say, or are dead; waits for one, for a moment."""
        ready = wait([worker.channel for worker in self._busy()], LOOK)
        return [worker for worker in self._busy() if worker.channel in ready]

    def _free(self) -> Worker:
        """A worker without a task.

        Raises:
            ResourceError: none can be started.
        """
        for worker in [worker for worker in self._workers if not worker.task]:
            if worker.process.is_alive():
                return worker
            self._bury(worker)
        if self._stillborn >= STILLBORN:
            raise ResourceError("worker processes end as soon as they begin; --workers 1 does without them")
        try:
            self._workers.append(Worker(self.workers))
        except OSError as error:
            raise ResourceError(f"a worker process cannot be started: {error.strerror}") from error
        return self._workers[-1]

    def _bury(self, worker: Worker) -> str:
        """Take leave of a worker that is dead, and say what it died of."""
        self._workers.remove(worker)
        worker.process.kill()
        worker.bury()
        self._stillborn = 0 if worker.heard else self._stillborn + 1
        code = worker.process.exitcode or 0
        if code >= 0:
            return f"ended with code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        return f"was killed ({name}{', for want of memory, perhaps' if -code == signal.SIGKILL else ''})"


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    """A process that is started in here never gets SIGINT and SIGTERM; this one gets them afterwards."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
