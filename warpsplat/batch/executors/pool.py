"""Do tasks in several processes of this machine, which are started once and kept.

Processes are spawned, since Warp and its threads do not survive a fork. A process that dies costs its task
a second try; ``concurrent.futures`` and loky would fail all tasks with it, and cannot ask one to stop.
"""

from __future__ import annotations

import contextlib
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterable, Iterator
from logging.handlers import QueueHandler
from multiprocessing.connection import Connection, wait
from pathlib import Path

from warpsplat.batch.executors.tasks import Executor, OnProgress, Outcome, Stop, Task
from warpsplat.errors import ResourceError, printable
from warpsplat.files.output import remove_stale

log = logging.getLogger("warpsplat")

GRACE = 10.0
"""Seconds that tasks have to end after they are asked to stop: for a step, and writing the file."""

POLL = 0.1
"""Seconds between two calls of ``stop``."""

PAUSE = 0.2
"""Seconds between two messages about the progress of a task."""

MOST_STILLBORN = 3
"""After so many workers in a row that die before they send a message, no more are started."""

STOP = "stop"
"""Message to a worker: end the task with the best so far. The others are tasks, and None: end yourself.

A worker sends the fraction of its task that is done, log records, and outcomes.
"""


class WorkerProcess:
    """A process as its parent sees it: with its channel and its task."""

    def __init__(self, workers: int) -> None:
        """Start a process; ``workers``: how many there will be."""
        context = multiprocessing.get_context("spawn")
        self.channel, other = context.Pipe()
        arguments = (other, log.getEffectiveLevel(), workers)
        self.process = context.Process(target=do_tasks, args=arguments, name="warpsplat worker")
        with _signals_blocked():
            self.process.start()
        other.close()
        self.task: Task | None = None
        self.begun = False
        """Whether the task has something to save."""
        self.responded = False
        """Whether it ever sent a message."""

    def give(self, task: Task) -> None:
        """Hand it a task; if it is dead, the channel is at its end, which ``receive`` notices."""
        self.task, self.begun = task, False
        self._send(task)

    def _send(self, message: object) -> None:
        with contextlib.suppress(OSError):
            self.channel.send(message)

    def receive(self, on_progress: OnProgress) -> Outcome | None:
        """Handle its next message, and return the outcome of its task if that has ended.

        Raises:
            EOFError, OSError: it is dead.
        """
        message = self.channel.recv()
        self.responded = True
        if isinstance(message, Outcome):
            self.task = None
            return message
        if isinstance(message, logging.LogRecord):
            logging.getLogger(message.name).handle(message)
        elif self.task:
            self.begun = True
            on_progress(self.task.number, message)
        return None

    def stop(self) -> None:
        """Have its task end with the best so far, or at once if there is nothing to save yet."""
        if self.begun:
            self._send(STOP)
        else:
            self.process.kill()

    def end(self) -> None:
        """End it: at once if it has a task."""
        if self.task:
            self.process.kill()
        else:
            self._send(None)

    def close(self) -> int:
        """Wait until it has ended, clean up, and return its exit code."""
        self.process.join(GRACE)
        self.process.kill()
        self.process.join()
        self.channel.close()
        if self.task and not self.task.bring:
            remove_stale(Path(self.task.output).parent)
        return self.process.exitcode or 0


class Pool(Executor):
    """Does tasks in processes, each with one at a time."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._workers: list[WorkerProcess] = []
        self._stillborn = 0

    def close(self) -> None:
        """See ``Executor``."""
        for worker in self._workers:
            worker.end()
        for worker in self._workers:
            worker.close()
        self._workers.clear()

    def run(self, tasks: Iterable[Task], stop: Stop, on_progress: OnProgress) -> Iterator[Outcome]:
        """See ``Executor``."""
        waiting, again, lost = iter(tasks), list[Task](), set[int]()
        deadline: float | None = None
        while True:
            if deadline is None and stop():
                deadline = time.monotonic() + GRACE
                for worker in self._busy():
                    worker.stop()
            while deadline is None and len(self._busy()) < self.workers:
                task = again.pop() if again else next(waiting, None)
                if task is None:
                    break
                self._idle_worker().give(task)
            if not self._busy():
                return
            if deadline is not None and time.monotonic() > deadline:
                for worker in self._busy():
                    worker.process.kill()
            for worker in self._ready():
                try:
                    outcome = worker.receive(on_progress)
                except (EOFError, OSError):
                    task, cause = worker.task, self._remove(worker)
                    assert task, "only busy workers are listened to"
                    if deadline is not None:
                        outcome = Outcome(task.number, "stopped")
                    elif task.number in lost:
                        error = f"{printable(task.name)}: its worker process {cause}, for the second time"
                        outcome = Outcome(task.number, "failed", error=error)
                    else:
                        lost.add(task.number)
                        again.append(task)
                        continue
                if outcome:
                    yield outcome

    def _busy(self) -> list[WorkerProcess]:
        return [worker for worker in self._workers if worker.task]

    def _ready(self) -> list[WorkerProcess]:
        """Return the busy workers that sent a message or died, after a short wait for one."""
        ready = wait([worker.channel for worker in self._busy()], POLL)
        return [worker for worker in self._busy() if worker.channel in ready]

    def _idle_worker(self) -> WorkerProcess:
        """Return a worker without a task; raise ``ResourceError`` if none can be started."""
        for worker in [worker for worker in self._workers if not worker.task]:
            if worker.process.is_alive():
                return worker
            self._remove(worker)
        if self._stillborn >= MOST_STILLBORN:
            raise ResourceError("worker processes end as soon as they begin; --workers 1 does without them")
        try:
            self._workers.append(WorkerProcess(self.workers))
        except OSError as error:
            raise ResourceError(f"a worker process cannot be started: {error.strerror}") from error
        return self._workers[-1]

    def _remove(self, worker: WorkerProcess) -> str:
        """Remove a dead worker, and return what it died of."""
        self._workers.remove(worker)
        worker.process.kill()
        code = worker.close()
        self._stillborn = 0 if worker.responded else self._stillborn + 1
        if code >= 0:
            return f"ended with code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        return f"was killed ({name}{', perhaps for lack of memory' if -code == signal.SIGKILL else ''})"


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block SIGINT and SIGTERM; a process started here never gets them, this one gets them afterwards.

    Ctrl-C reaches all processes of a terminal: the parent alone handles it.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Forward(QueueHandler):
    """Sends log records to the parent, which shows them as its own."""

    def enqueue(self, record: logging.LogRecord) -> None:
        self.queue.send(record)  # type: ignore[attr-defined]


def do_tasks(channel: Connection, level: int, workers: int) -> None:
    """Do the tasks that come through ``channel`` until None comes: the main function of a worker process.

    Args:
        channel: to the parent.
        level: level of the log records that the parent shows.
        workers: how many processes share the machine.
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()
    log.addHandler(_Forward(channel))  # type: ignore[arg-type]
    log.propagate = False
    log.setLevel(level)
    with contextlib.suppress(EOFError, OSError):  # the parent is dead
        while (task := channel.recv()) is not None:
            if task != STOP:  # which came too late
                _do_task(channel, task, workers)


def _end_with_parent() -> None:
    """Wait until the parent is dead, then end this process at once, before it writes any more."""
    parent = multiprocessing.parent_process()
    assert parent
    parent.join()
    os._exit(1)


def _do_task(channel: Connection, task: Task, workers: int) -> None:
    from warpsplat.batch.executors.work import do
    from warpsplat.run.memory import Sharing

    Sharing.processes = workers
    stopped, sent = False, -PAUSE

    def on_progress(number: int, fraction: float) -> None:
        nonlocal sent
        if time.monotonic() - sent > PAUSE:
            sent = time.monotonic()
            channel.send(fraction)

    def stop() -> bool:
        nonlocal stopped
        if sent < 0:  # from now on there is something to save
            on_progress(task.number, 0.0)
        if not stopped and channel.poll():
            channel.recv()
            stopped = True
        return stopped

    channel.send(do(task, stop, on_progress))
