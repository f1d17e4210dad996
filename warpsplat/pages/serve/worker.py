"""The worker: one thread that does the queued runs one by one, each with the whole machine."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import traceback
from collections.abc import Iterator
from dataclasses import dataclass

import warpsplat
from warpsplat.errors import explain
from warpsplat.native import release_memory
from warpsplat.pages.serve.live import Live
from warpsplat.pages.serve.sessions import QueuedRun
from warpsplat.pages.serve.store import Store
from warpsplat.run.result import Result


@dataclass(frozen=True)
class Machine:
    """Where runs are computed."""

    device: str = "auto"
    threads: int | None = None


class RunThread(threading.Thread):
    """Does the runs of a store's queue until the store is closed."""

    def __init__(self, store: Store, machine: Machine) -> None:
        # A daemon: when the program has to end at once, as within the compiler, it does not wait for a run.
        super().__init__(name="runs", daemon=True)
        self._store, self._machine = store, machine

    def run(self) -> None:
        """Do one run after the other."""
        while run := self._store.next():
            with _notices_to(run.live):
                outcome = self._outcome(run)
            self._store.finish(run, outcome)
            del run, outcome
            release_memory()

    def _outcome(self, run: QueuedRun) -> Result | str:
        """Return the result, or the error."""
        try:
            return warpsplat.vectorize(
                run.upload.data,
                settings=run.settings,
                name=run.upload.name,
                device=self._machine.device,
                threads=self._machine.threads,
                callback=run.live,
                stop=run.stopping.is_set,
            )
        except BaseException as error:  # whatever it is, the next run may succeed
            if os.environ.get("WARPSPLAT_TRACEBACK"):
                traceback.print_exception(error)
            return explain(error)[0]


@contextlib.contextmanager
def _notices_to(live: Live) -> Iterator[None]:
    """Show the notices of the library on a run's page."""
    log, handler = logging.getLogger("warpsplat"), logging.Handler()
    handler.emit = lambda record: live.notify(record.getMessage())  # type: ignore[method-assign]
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
