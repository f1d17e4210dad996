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
from collections.abc import Iterator
from logging.handlers import QueueHandler
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext, SpawnContext

from warpsplat.batch.executors.tasks import OnProgress, Outcome, Task
from warpsplat.batch.executors.workers import WorkerExecutor
from warpsplat.errors import ResourceError

log = logging.getLogger("warpsplat")

CONTEXT: SpawnContext | ForkServerContext = multiprocessing.get_context("spawn")
"""How processes are started: on every version of Python the same way."""

PAUSE = 0.2
"""Seconds between two messages about the progress of a task."""

STOP = "stop"
"""Message to a worker: end the task with the best so far. The others are tasks.

A worker sends the fraction of its task that is done, log records, and outcomes.
"""


class WorkerProcess:
    """A process as its parent sees it: with its channel and its task."""

    def __init__(self, workers: int) -> None:
        """Start a process; ``workers``: how many there will be."""
        self.channel, other = CONTEXT.Pipe()
        arguments = (other, log.getEffectiveLevel(), workers)
        self.process = CONTEXT.Process(target=do_tasks, args=arguments, name="warpsplat worker")
        with _signals_blocked():
            self.process.start()
        other.close()
        self.task: Task | None = None
        self.begun = False
        """Whether the task has something to save."""
        self.responded = False

    def give(self, task: Task) -> None:
        """See ``TaskWorker``; if it is dead, the channel is at its end, which is noticed later."""
        self.task, self.begun = task, False
        self._send(task)

    def _send(self, message: object) -> None:
        with contextlib.suppress(OSError):
            self.channel.send(message)

    def stop(self) -> None:
        """See ``TaskWorker``."""
        if self.begun or wait([self.channel], 0):  # what is not received yet may say that it has begun
            self._send(STOP)
        else:
            self.process.kill()

    def end(self) -> None:
        """See ``TaskWorker``."""
        self.process.kill()
        self.process.join()
        self.channel.close()

    def cause_of_death(self) -> str:
        """Return what a process that has ended died of."""
        code = self.process.exitcode or 0
        if code >= 0:
            return f"process ended with code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        perhaps = ", perhaps for lack of memory" if -code == signal.SIGKILL else ""
        return f"process was killed ({name}{perhaps})"


class Pool(WorkerExecutor[WorkerProcess]):
    """Does tasks in processes of this machine."""

    tries = 2
    stillborn = "worker processes end as soon as they begin (--workers 1 does without them)"

    def __init__(self, workers: int) -> None:
        super().__init__()
        self.workers = workers

    def _has_place(self) -> bool:
        return len(self._busy()) < self.workers

    def _worker_for(self, task: Task) -> WorkerProcess:
        """Return a worker without a task; raise ``ResourceError`` if none can be started."""
        for worker in [worker for worker in self._workers if not worker.task]:
            if worker.process.is_alive():
                return worker
            self._remove([worker])
        try:
            self._workers.append(WorkerProcess(self.workers))
        except OSError as error:
            raise ResourceError(f"a worker process cannot be started: {error.strerror}") from error
        return self._workers[-1]

    def _receive(self, on_progress: OnProgress) -> Iterator[Outcome]:
        poll = 0.1  # seconds between two calls of stop
        ready = wait([worker.channel for worker in self._busy()], poll)
        for worker in [worker for worker in self._busy() if worker.channel in ready]:
            try:
                message = worker.channel.recv()
            except (EOFError, OSError):
                worker.process.join(poll)
                worker.end()
                message = self._lost(worker, worker.cause_of_death())
            else:
                worker.responded = True
            if isinstance(message, Outcome):
                worker.task = None
                if message.spent:
                    self._remove([worker])
                yield message
            elif isinstance(message, logging.LogRecord):
                logging.getLogger(message.name).handle(message)
            elif message is not None and worker.task:
                worker.begun = True
                on_progress(worker.task.number, message)


@contextlib.contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block SIGINT and SIGTERM; a process started here never gets them, this one gets them afterwards.

    Ctrl-C reaches all processes of a terminal: the parent alone handles it.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        resource_tracker.ensure_running()  # started by the first process otherwise, it unblocks the signals
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Forward(QueueHandler):
    """Sends log records to the parent, which shows them as its own."""

    def enqueue(self, record: logging.LogRecord) -> None:
        self.queue.send(record)  # type: ignore[attr-defined]


def do_tasks(channel: Connection, level: int, workers: int) -> None:
    """Do the tasks that come through ``channel``: the main function of a worker process.

    ``level``: of the log records that the parent shows; ``workers``: how many processes share the machine.
    """
    for number in (signal.SIGINT, signal.SIGTERM):  # where they could not be blocked
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    log.addHandler(_Forward(channel))  # type: ignore[arg-type]
    log.propagate = False
    log.setLevel(level)
    with contextlib.suppress(EOFError, OSError):  # the parent is dead
        while task := channel.recv():
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
    from warpsplat.run import memory

    memory.processes = workers
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
