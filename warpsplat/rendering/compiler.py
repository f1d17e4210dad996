"""The thread that compiles kernels, and the messages meanwhile."""

from __future__ import annotations

import functools
import logging
import os
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait

from warpsplat.native import messages_hidden

log = logging.getLogger(__name__)

PASSING = "passing"
"""Attribute of log records that the next such record replaces; an empty message removes them."""

MESSAGE_INTERVAL = 1.0
"""Seconds between two such messages."""


class BuildError(Exception):
    """A module that cannot be compiled, or loaded then, in the words of the compiler or loader."""


class _Compiler:
    """One thread for all modules of a process.

    Warp precompiles its headers again in each thread that compiles, which takes as long as a dozen small
    modules.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        """Time that the process has waited for all modules so far."""
        self._latest: Future[None] | None = None
        self._tasks: queue.SimpleQueue[tuple[Callable[[], None], Future[None]]] = queue.SimpleQueue()
        threading.Thread(target=self._serve, name="warpsplat compiler", daemon=True).start()

    def _serve(self) -> None:
        while True:
            work, future = self._tasks.get()
            try:
                work()
            except BaseException as error:  # raised again where it is waited for
                future.set_exception(error)
            else:
                future.set_result(None)

    def ask(self, work: Callable[[], None]) -> Future[None]:
        """Queue ``work`` behind earlier requests."""
        self._latest = future = Future[None]()
        self._tasks.put((work, future))
        return future

    def is_busy(self) -> bool:
        """Return whether work is left, e.g. that of a caller who was interrupted."""
        return self._latest is not None and not self._latest.done()


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


def compile_by(work: Callable[[], None]) -> None:
    """Do ``work`` in the compiler's thread, so that Ctrl-C need not wait for it; log how long it takes.

    Raises:
        BuildError: it failed, and native code said why.
    """
    _announce()
    compiler = _compiler()
    with messages_hidden() as said:
        started = time.monotonic()
        future = compiler.ask(work)
        while not wait([future], MESSAGE_INTERVAL).done:
            seconds = compiler.seconds + time.monotonic() - started
            log.info("compiling kernels: %d s", seconds, extra={PASSING: True})
        compiler.seconds += time.monotonic() - started
    log.info("", extra={PASSING: True})
    error, cause = future.exception(), first_error(said)
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


def compiling() -> bool:
    """Return whether the compiler is working: a process that ends then must not remove its files."""
    return _compiler.cache_info().currsize > 0 and _compiler().is_busy()
