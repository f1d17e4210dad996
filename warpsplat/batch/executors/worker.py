"""A process of ``pool.Pool``: does the tasks that come through its channel, and never outlives its parent.

The parent blocked SIGINT and SIGTERM before it started this process, so that Ctrl-C in a terminal, which goes
to all processes there, is the parent's to answer.
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
"""Said by the parent: end the task in work, with the best so far."""

PAUSE = 0.2
"""Seconds between two messages on how far a task is."""


class Part(NamedTuple):
    """Which part of a task is done; the first one says that there is something to save."""

    number: int
    done: float


class Notice(NamedTuple):
    """What a library logged."""

    level: int
    text: str


class _Notices(logging.Handler):
    """Sends notices to the parent, which shows them as its own."""

    def __init__(self, channel: Connection) -> None:
        super().__init__()
        self._channel = channel

    def emit(self, record: logging.LogRecord) -> None:
        with contextlib.suppress(OSError):
            self._channel.send(Notice(record.levelno, record.getMessage()))


def main(channel: Connection, parent: int, level: int, workers: int) -> None:
    """Do tasks until None comes, or nobody is left to send it.

    Args:
        channel: to the parent.
        parent: its process number.
        level: of the notices that it shows.
        workers: how many share the machine, this one counted.
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
        if isinstance(task, Task):  # a word to stop that came too late is none
            _serve(channel, task, workers)


def _serve(channel: Connection, task: Task, workers: int) -> None:
    from warpsplat.batch.executors.work import do
    from warpsplat.fit.progress import (
        Progress,
    )  # in here, as all that is heavy: the process must first be safe
    from warpsplat.run.memory import share_machine

    share_machine(workers)
    stopped, begun, told = False, False, 0.0

    def stop() -> bool:
        nonlocal stopped, begun
        if not begun:
            begun = True
            channel.send(Part(task.number, 0.0))
        while not stopped and channel.poll():
            stopped = _received(channel) == STOP
        return stopped

    def on_progress(progress: Progress) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told > PAUSE:
            told = now
            channel.send(Part(task.number, progress.work))

    channel.send(do(task, stop, on_progress))


def _received(channel: Connection) -> object:
    """The next message; without a parent the process ends here, before it writes any more."""
    try:
        return channel.recv()
    except (EOFError, OSError):
        os._exit(1)


def _end_with(parent: int) -> None:
    """Have the system kill this process as soon as its parent is dead, where it can do that (Linux)."""
    if sys.platform == "linux":
        set_death_signal = 1
        ctypes.CDLL(None).prctl(set_death_signal, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
