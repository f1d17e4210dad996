"""The worker: one thread that does the queued runs one by one, each with the whole machine."""

from __future__ import annotations

import logging
import os
import threading
import traceback
from dataclasses import dataclass

import warpsplat
from warpsplat.errors import explain
from warpsplat.native import release_memory
from warpsplat.pages.serve.live import LiveRun
from warpsplat.pages.serve.sessions import QueuedRun
from warpsplat.pages.serve.store import Store
from warpsplat.run.result import Result


@dataclass(frozen=True)
class Machine:
    """Where runs are computed, and within which limit of memory."""

    device: str = "auto"
    threads: int | None = None
    max_memory: str | None = None


def start_worker(store: Store, machine: Machine) -> threading.Thread:
    """Start a thread that does the runs of a store's queue until the store is closed."""
    # A daemon: when the program has to end at once, as within the compiler, it does not wait for a run.
    thread = threading.Thread(target=_work, args=(store, machine), name="runs", daemon=True)
    thread.start()
    return thread


def _work(store: Store, machine: Machine) -> None:
    log = logging.getLogger("warpsplat")
    while run := store.next():
        notices = _Notices(run.live)
        log.addHandler(notices)
        outcome = _outcome(run, machine)
        log.removeHandler(notices)
        store.finish(run, outcome)
        del run, outcome, notices
        release_memory()


def _outcome(run: QueuedRun, machine: Machine) -> Result | str:
    """Return the result of a run, or its error."""
    try:
        return warpsplat.vectorize(
            run.upload.data,
            settings=run.settings,
            name=run.upload.name,
            device=machine.device,
            threads=machine.threads,
            callback=run.live,
            stop=run.stopping.is_set,
        )
    except BaseException as error:  # whatever it is, the next run may succeed
        if os.environ.get("WARPSPLAT_TRACEBACK"):
            traceback.print_exception(error)
        return explain(error)[0]


class _Notices(logging.Handler):
    """Shows the notices of the library on a run's page."""

    def __init__(self, live: LiveRun) -> None:
        super().__init__()
        self._live = live

    def emit(self, record: logging.LogRecord) -> None:
        self._live.notify(record.getMessage())
