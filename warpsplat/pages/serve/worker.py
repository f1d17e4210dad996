"""The worker: one thread that does the queued runs one by one, each with the whole machine."""

from __future__ import annotations

import logging
import os
import threading
import traceback
from dataclasses import dataclass, replace

import warpsplat
from warpsplat.errors import explain
from warpsplat.fit.settings import Settings
from warpsplat.native import release_memory
from warpsplat.pages.serve.live import LiveRun
from warpsplat.pages.serve.runs import QueuedRun
from warpsplat.pages.serve.store import Store
from warpsplat.run.result import Result


@dataclass(frozen=True)
class Machine:
    """Where runs are computed, and within which limit of memory."""

    device: str = "auto"
    threads: int | None = None
    max_memory: str | None = None


class Cancelled(Exception):  # noqa: N818 - no fault
    """Nobody wants the result of a run any more."""


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
        outcome = _outcome(run, machine, store)
        log.removeHandler(notices)
        store.finish(run, outcome)
        del run, outcome, notices
        release_memory()


def _outcome(run: QueuedRun, machine: Machine, store: Store) -> Result | str:
    """Return the result of a run, or its error."""

    def stop() -> bool:
        if not store.is_wanted(run):
            raise Cancelled  # at once: the file of a run that is stopped is measured
        return run.stopping.is_set()

    def made(settings: Settings) -> Result:
        return warpsplat.vectorize(
            run.upload.data,
            settings=settings,
            name=run.upload.name,
            device=machine.device,
            threads=machine.threads,
            callback=run.live,
            stop=stop,
        )

    try:
        draft = None
        if run.order.draft:
            run.live.begin(is_draft=True)
            draft = made(run.order.draft)
            if stop():
                return replace(draft, stopped=True)
            run.live.show_draft(draft)
        run.live.begin()
        result = made(run.order.settings)
        return replace(draft, stopped=True) if draft and _is_worse(result, draft) else result
    except Cancelled:
        return ""
    except BaseException as error:  # whatever it is, the next run may succeed
        if os.environ.get("WARPSPLAT_TRACEBACK"):
            traceback.print_exception(error)
        return explain(error)[0]


def _is_worse(result: Result, draft: Result) -> bool:
    """Return whether a run was stopped before it was as good as its draft."""
    if not result.stopped or draft.score is None:
        return False
    return result.score is None or result.score.psnr < draft.score.psnr


class _Notices(logging.Handler):
    """Shows the notices of the library on a run's page."""

    def __init__(self, live: LiveRun) -> None:
        super().__init__()
        self._live = live

    def emit(self, record: logging.LogRecord) -> None:
        self._live.notify(record.getMessage())
