"""The threads that compile kernels, and the messages meanwhile."""

from __future__ import annotations

import atexit
import functools
import logging
import os
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait

from warpsplat.native import available_cores, messages_hidden
from warpsplat.rendering.headers import SharedHeaders

log = logging.getLogger(__name__)

PASSING = "passing"
"""Attribute of log records that the next such record replaces; an empty message removes them."""

MESSAGE_INTERVAL = 1.0
"""Seconds between two such messages."""


class BuildError(Exception):
    """A module that cannot be compiled, or loaded then, in the words of the compiler or loader."""


class _Compiler:
    """Threads that compile modules side by side, one for each core; the compiler releases Python's lock."""

    def __init__(self) -> None:
        self.seconds = 0.0
        """Time that the process has waited for all modules so far."""
        self._unfinished: set[Future[None]] = set()
        self._tasks: queue.SimpleQueue[tuple[Callable[[], None], Future[None]]] = queue.SimpleQueue()
        self._headers = SharedHeaders()
        for number in range(1, available_cores() + 1):
            name = f"warpsplat compiler {number}"
            threading.Thread(target=self._serve, name=name, daemon=True).start()

    def _serve(self) -> None:
        while True:
            work, future = self._tasks.get()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                work()
            except BaseException as error:  # raised again where it is waited for
                future.set_exception(error)
            else:
                future.set_result(None)
            finally:
                self._headers.done()

    def ask(self, work: Callable[[], None]) -> Future[None]:
        """Queue ``work`` behind earlier requests."""
        future = Future[None]()
        self._unfinished.add(future)
        future.add_done_callback(self._unfinished.discard)
        self._tasks.put((work, future))
        return future

    def finish(self, timeout: float | None = None) -> bool:
        """Drop the work that has not begun, and wait for the rest; return whether that was in time [s]."""
        return not wait([left for left in list(self._unfinished) if not left.cancel()], timeout).not_done


@functools.cache
def _compiler() -> _Compiler:
    """Return the compiler, started at the first call."""
    return _Compiler()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_compiler.cache_clear)  # threads do not survive a fork


@functools.cache
def _announce() -> None:
    """Log, once per process, why nothing seems to happen."""
    log.info("compiling kernels, which is done once and takes up to a minute")


def compile_later(work: Callable[[], None]) -> Future[None]:
    """Have ``work`` done by the compiler's threads, behind what they were asked for before."""
    return _compiler().ask(work)


def wait_for(ask: Callable[[], Future[None]]) -> None:
    """Wait for what ``ask`` returns, so that Ctrl-C need not wait for the compiler; log how long it takes.

    Raises:
        BuildError: it failed, and native code said why.
    """
    _announce()
    compiler = _compiler()
    with messages_hidden() as said:
        started = time.monotonic()
        future = ask()
        while not wait([future], MESSAGE_INTERVAL).done:
            seconds = compiler.seconds + time.monotonic() - started
            log.info("compiling kernels: %d s", seconds, extra={PASSING: True})
        compiler.seconds += time.monotonic() - started
        error = future.exception()
        if error:
            compiler.finish()  # other modules are likely to fail as well, which is not to be seen
    log.info("", extra={PASSING: True})
    cause = first_error(said)
    if cause and isinstance(error, Exception) and not isinstance(error, (OSError, MemoryError)):
        raise BuildError(cause) from error
    future.result()


def first_error(lines: list[str]) -> str:
    """Return the first error among messages of native code; empty: there is none."""
    found = [line.strip() for line in lines if "error" in line]
    return next((line for line in found if "error:" in line), found[0] if found else "")


def compile_seconds() -> float:
    """Return how long this process has waited for kernels to be compiled [s]."""
    return _compiler().seconds if _compiler.cache_info().currsize else 0.0


def compiler_finished(timeout: float | None = None) -> bool:
    """Drop what is not yet being compiled, and return whether the rest ends in ``timeout`` seconds.

    Else a process that ends must not remove the compiler's files.
    """
    return not _compiler.cache_info().currsize or _compiler().finish(timeout)


atexit.register(compiler_finished)
