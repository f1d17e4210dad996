"""A process of ``pool.Pool``: does the tasks from its channel, and never outlives its parent.

The parent blocked SIGINT and SIGTERM before it started this process, so that only the parent handles Ctrl-C,
which a terminal sends to all processes.
"""

from __future__ import annotations

import contextlib
import ctypes
import logging
import os
import signal
import sys
import time
from multiprocessing.connection import Connection
from typing import NamedTuple

from warpsplat.batch.executors.tasks import Task

STOP = "stop"
"""Message of the parent: end the current task, with the best so far."""

PAUSE = 0.2
"""Seconds between two messages of progress."""


class Part(NamedTuple):
    """Progress of a task; after the first one there is a result to save."""

    number: int
    done: float


class Notice(NamedTuple):
    """A message that a library logged."""

    level: int
    text: str


class _Notices(logging.Handler):
    """Sends notices to the parent, which prints them."""

    def __init__(self, channel: Connection) -> None:
        super().__init__()
        self._channel = channel

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError):
            self._channel.send(Notice(record.levelno, record.getMessage()))


def main(channel: Connection, parent: int, level: int, workers: int) -> None:
    """Do tasks until None comes or the parent is gone.

    Args:
        channel: to the parent.
        parent: its process number.
        level: level of notices to send.
        workers: how many share the machine, including this one.
    """
    _end_with(parent)
    log = logging.getLogger("warpsplat")
    log.addHandler(_Notices(channel))
    log.propagate = False
    log.setLevel(level)
    while True:
        task = _received(channel)
        if task is None:
            return
        if isinstance(task, Task):  # ignore a late message to stop
            _serve(channel, task, workers)


def _serve(channel: Connection, task: Task, workers: int) -> None:
    from warpsplat.batch.executors.work import do
    from warpsplat.fit.progress import Progress  # heavy imports come after the set-up above
    from warpsplat.run.memory import share_machine

    share_machine(workers)
    stopped, begun, reported = False, False, 0.0

    def stop() -> bool:
        nonlocal stopped, begun
        if not begun:
            begun = True
            channel.send(Part(task.number, 0.0))
        while not stopped and channel.poll():
            stopped = _received(channel) == STOP
        return stopped

    def on_progress(progress: Progress) -> None:
        nonlocal reported
        now = time.monotonic()
        if now - reported > PAUSE:
            reported = now
            channel.send(Part(task.number, progress.work))

    channel.send(do(task, stop, on_progress))


def _received(channel: Connection) -> object:
    """Return the next message; exit if the parent is gone."""
    try:
        return channel.recv()
    except (EOFError, OSError):
        os._exit(1)


def _end_with(parent: int) -> None:
    """Let the system kill this process as soon as its parent dies (Linux only)."""
    if sys.platform == "linux":
        set_death_signal = 1
        ctypes.CDLL(None).prctl(set_death_signal, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
