"""Threads that share the launches of a program."""

from __future__ import annotations

import contextlib
import functools
import os
import queue
import threading
from collections.abc import Callable


class Request:
    """Work for one helper, and what became of it."""

    def __init__(self, work: Callable[[], None]) -> None:
        self.work = work
        self.error: BaseException | None = None
        self.busy = threading.Lock()
        self.busy.acquire()

    def serve(self) -> None:
        """Do the work, in a helper."""
        try:
            self.work()
        except BaseException as error:  # raised again where it is waited for
            self.error = error
        finally:
            self.busy.release()

    def wait(self) -> None:
        """Until the work is done; raises what it raised."""
        self.busy.acquire()
        if self.error:
            raise self.error


class Helpers:
    """Threads beside the caller's, fewer than asked for where no more can be started.

    A split launch takes some hundred microseconds and a step has twenty: a queue and a lock wake a thread in
    half the time of an executor and its futures, which is a tenth of a step.
    """

    def __init__(self, count: int) -> None:
        self.requests: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self.count = 0
        with contextlib.suppress(RuntimeError):
            for _ in range(count):
                threading.Thread(target=self._serve, name="warpsplat", daemon=True).start()
                self.count += 1

    def _serve(self) -> None:
        while True:
            self.requests.get().serve()

    def ask(self, work: Callable[[], None]) -> Request:
        """Have one helper do ``work``."""
        request = Request(work)
        self.requests.put(request)
        return request


@functools.cache
def helpers(threads: int) -> Helpers:
    """Kept for the next program."""
    return Helpers(threads - 1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=helpers.cache_clear)  # threads do not survive a fork
