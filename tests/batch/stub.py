"""A worker process that does nothing but what a task's name says, without anything heavy."""

from __future__ import annotations

import logging
import os
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path

from warpsplat.batch.executors.tasks import Outcome, Task

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def signal_group() -> None:
    """Send both signals to all processes of this group, as a terminal or a service manager does."""
    for number in SIGNALS:
        os.killpg(0, number)


def main(channel: Connection, level: int, workers: int) -> None:
    while isinstance(task := channel.recv(), Task):
        what = task.name
        if what == "stillborn":
            os._exit(3)
        channel.send(0.5)
        if what == "die" or (what == "die once" and not Path(task.output).exists()):
            Path(task.output).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        if what == "notice":
            channel.send(logging.makeLogRecord({"name": "warpsplat", "levelno": 30, "msg": "a notice"}))
        status = "made"
        if what == "wait":
            channel.recv()
            status = "stopped"
        if what == "signal group":
            signal_group()
        if what == "hang":
            time.sleep(60)
        blocked = [int(number) for number in signal.pthread_sigmask(signal.SIG_BLOCK, ())]
        figures = {"process": os.getpid(), "blocked": blocked}
        channel.send(Outcome(task.number, status, figures=figures))
