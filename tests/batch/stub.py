"""A worker process that does nothing but what a task's name says, without anything heavy."""

from __future__ import annotations

import logging
import os
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path

from warpsplat.batch.executors.tasks import Outcome, Task


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
        if what == "hang":
            time.sleep(60)
        channel.send(Outcome(task.number, status, figures={"process": os.getpid()}))
