"""Threads that share the launches of a program."""

from __future__ import annotations

import contextlib
import functools
import os
import queue
import threading
from collections.abc import Callable, Sequence


class LaunchRequest:
    """Work for one helper thread."""

    def __init__(self, work: Callable[[], None]) -> None:
        self._work = work
        self._error: BaseException | None = None
        self._claim = threading.Lock()
        """Taken by the helper that begins, or by the caller that withdraws, whichever comes first."""
        self._done = threading.Lock()
        self._done.acquire()

    def serve(self) -> None:
        """Do the work, called by a helper, unless it was withdrawn."""
        if not self._claim.acquire(blocking=False):
            return
        try:
            self._work()
        except BaseException as error:  # raised again where it is waited for
            self._error = error
        finally:
            self._done.release()

    def settle(self) -> None:
        """Withdraw the work if no helper has begun; else wait for it, and raise what it raised."""
        if self._claim.acquire(blocking=False):
            return
        self._done.acquire()
        if self._error:
            raise self._error


class Helpers:
    """Threads beside the caller's, fewer than asked for where no more can be started.

    A split launch takes some hundred microseconds and a step has twenty: a queue and a lock wake a thread in
    half the time of an executor and its futures, which is a tenth of a step.
    """

    def __init__(self, count: int) -> None:
        self.requests: queue.SimpleQueue[LaunchRequest] = queue.SimpleQueue()
        self.count = 0
        with contextlib.suppress(RuntimeError):
            for _ in range(count):
                threading.Thread(target=self._serve, name="warpsplat", daemon=True).start()
                self.count += 1

    def _serve(self) -> None:
        while True:
            self.requests.get().serve()

    def ask(self, work: Callable[[], None]) -> LaunchRequest:
        """Have one helper do ``work``."""
        request = LaunchRequest(work)
        self.requests.put(request)
        return request


@functools.cache
def helpers(threads: int) -> Helpers:
    """Return the helpers for so many threads, kept for the next program."""
    return Helpers(threads - 1)


def shared(works: Sequence[Callable[[], None]], threads: int) -> None:
    """Do all ``works``, at the same time on up to so many threads."""
    rest = iter(works)

    def work() -> None:
        # Taking from a shared iterator is atomic: each thread takes the next piece when it is done.
        for each in rest:
            each()

    requests: list[LaunchRequest] = []
    if len(works) > 1 and threads > 1:
        crew = helpers(threads)
        requests = [crew.ask(work) for _ in range(min(crew.count, len(works) - 1))]
    try:
        work()
    finally:  # an interruption must not free arrays that helpers still write
        for request in requests:
            request.settle()  # on a busy machine helpers may come too late


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=helpers.cache_clear)  # threads do not survive a fork
