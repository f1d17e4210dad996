"""Do the runs in one thread, one after the other, each with the whole machine."""

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
from warpsplat.pages.serve.runs import Run
from warpsplat.pages.serve.store import Store
from warpsplat.run.result import Result


@dataclass(frozen=True)
class Machine:
    """Device and threads of runs."""

    device: str = "auto"
    threads: int | None = None


class Worker(threading.Thread):
    """Does the runs in a store's queue until it is closed."""

    def __init__(self, store: Store, machine: Machine) -> None:
        # Where the program has to end at once, as within the compiler, it does not wait for a run.
        super().__init__(name="runs", daemon=True)
        self._store, self._machine = store, machine

    def run(self) -> None:
        """Do one run after the other."""
        while run := self._store.next():
            with _notices(run.live):
                outcome = self._made(run)
            self._store.finish(run, outcome)
            del run, outcome
            release_memory()

    def _made(self, run: Run) -> Result | str:
        """Return the result, or an error."""
        try:
            return warpsplat.vectorize(
                run.picture.data,
                settings=run.settings,
                name=run.picture.name,
                device=self._machine.device,
                threads=self._machine.threads,
                callback=run.live,
                stop=run.stopping.is_set,
            )
        except BaseException as error:  # whatever it is, the next run may do better
            if os.environ.get("WARPSPLAT_TRACEBACK"):
                traceback.print_exception(error)
            return explain(error)[0]


class _Handler(logging.Handler):
    def __init__(self, live: Live) -> None:
        super().__init__()
        self._live = live

    def emit(self, record: logging.LogRecord) -> None:
        self._live.notify(record.getMessage())


@contextlib.contextmanager
def _notices(live: Live) -> Iterator[None]:
    """Show the library's notices on the run's page."""
    log, handler = logging.getLogger("warpsplat"), _Handler(live)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
