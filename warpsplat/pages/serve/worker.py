"""Who does the runs: one thread, one run after the other, each with all that the machine has."""

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
from warpsplat.pages.serve.runs import ServedRun
from warpsplat.pages.serve.store import Store
from warpsplat.run.result import Result


@dataclass(frozen=True)
class Machine:
    """Where runs are computed."""

    device: str = "auto"
    threads: int | None = None


class Worker(threading.Thread):
    """Does what is in a store's queue until that is closed."""

    def __init__(self, store: Store, machine: Machine) -> None:
        # Where the program has to end at once, as within the compiler, it does not wait for a run.
        super().__init__(name="runs", daemon=True)
        self._store, self._machine = store, machine

    def run(self) -> None:
        """One run after the other."""
        while run := self._store.next():
            with _notices(run.live):
                outcome = self._made(run)
            self._store.finish(run, outcome)
            del run, outcome
            release_memory()

    def _made(self, run: ServedRun) -> Result | str:
        """The result, or why there is none."""
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
        self._live.say(record.getMessage())


@contextlib.contextmanager
def _notices(live: Live) -> Iterator[None]:
    """Tell a run's page what the library says meanwhile."""
    log, handler = logging.getLogger("warpsplat"), _Handler(live)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
