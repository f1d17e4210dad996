"""Do several tasks at the same time, each in a process, which is kept for further tasks.

Processes are spawned, since Warp and its threads do not survive a fork. A process that dies would break
Python's own pools; here its task is tried once more.
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
"""Seconds for a task to end once it is stopped: a step, and writing the file."""

POLL_INTERVAL = 0.1
"""Seconds between two checks whether to stop."""

TRIES = 2
"""Attempts at a task whose worker dies."""

MAX_FAILED_STARTS = 3
"""After this many workers in a row that die before they respond, no more are started."""


class Worker:
    """A process, the channel to it, and its current task."""

    def __init__(self, workers: int) -> None:
        """``workers``: how many there are, including this one."""
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
        """Whether the task has a result to save."""
        self.responded = False
        """Whether it ever sent a message."""

    def give(self, task: Task) -> None:
        """Send it a task. If it is dead, its channel ends, which ``run`` notices."""
        self.task, self.begun = task, False
        with contextlib.suppress(OSError):
            self.channel.send(task)

    def listen(self, advance: Advance) -> Outcome | None:
        """Receive its next message.

        Raises:
            EOFError, OSError: it is dead.
        """
        message = self.channel.recv()
        self.responded = True
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
        """End its task: with the best so far, or at once if there is nothing yet."""
        if self.begun:
            with contextlib.suppress(OSError):
                self.channel.send(STOP)
        else:
            self.process.kill()

    def dismiss(self) -> None:
        """End it: by itself if it is idle, else at once."""
        if self.task:
            self.process.kill()
            return
        with contextlib.suppress(OSError):
            self.channel.send(None)

    def clean_up(self) -> None:
        """Wait until it has ended, and remove what it left."""
        self.process.join(GRACE)
        self.process.kill()
        self.process.join()
        self.channel.close()
        if self.task and not self.task.bring:
            remove_stale(Path(self.task.output).parent)


class Pool:
    """An ``Executor`` that has several processes."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._workers: list[Worker] = []
        self._failed_starts = 0

    def __enter__(self) -> Pool:
        """Return self; workers start with the first tasks."""
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
            worker.clean_up()
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
            for worker in self._ready():
                task = worker.task
                try:
                    outcome = worker.listen(advance)
                except (EOFError, OSError):
                    assert task
                    cause = self._remove(worker)
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

    def _ready(self) -> list[Worker]:
        """Wait a moment, and return the busy workers that sent a message or died."""
        ready = wait([worker.channel for worker in self._busy()], POLL_INTERVAL)
        return [worker for worker in self._busy() if worker.channel in ready]

    def _free(self) -> Worker:
        """Return a worker without a task.

        Raises:
            ResourceError: none can be started.
        """
        for worker in [worker for worker in self._workers if not worker.task]:
            if worker.process.is_alive():
                return worker
            self._remove(worker)
        if self._failed_starts >= MAX_FAILED_STARTS:
            raise ResourceError("worker processes end as soon as they begin; --workers 1 does without them")
        try:
            self._workers.append(Worker(self.workers))
        except OSError as error:
            raise ResourceError(f"a worker process cannot be started: {error.strerror}") from error
        return self._workers[-1]

    def _remove(self, worker: Worker) -> str:
        """Remove a dead worker, and return how it ended."""
        self._workers.remove(worker)
        worker.process.kill()
        worker.clean_up()
        self._failed_starts = 0 if worker.responded else self._failed_starts + 1
        code = worker.process.exitcode or 0
        if code >= 0:
            return f"ended with code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        return f"was killed ({name}{', maybe out of memory' if -code == signal.SIGKILL else ''})"


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block SIGINT and SIGTERM in processes started in the block; this process gets them afterwards."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
