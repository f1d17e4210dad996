"""Who may use Warp at the same time.

Launches on a CPU do not disturb each other. But what any thread launches while a graph is captured becomes
part of it, and on a GPU all launches of a process go to one stream.
"""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator

import warp as wp

_lock = threading.RLock()
_inside: list[int] = []
"""Threads that are doing work, an entry for each piece of it."""


@contextlib.contextmanager
def turn(device: wp.Device) -> Iterator[None]:
    """Do work on ``device``: on a GPU alone, on a CPU beside other threads. May be nested."""
    with _alone_on(str(device)) if device.is_cuda else contextlib.nullcontext():
        me = threading.get_ident()
        with _lock:
            _inside.append(me)
        try:
            yield
        finally:
            with _lock:
                _inside.remove(me)


@functools.cache
def _alone_on(device: str) -> threading.RLock:
    return threading.RLock()


@contextlib.contextmanager
def undisturbed() -> Iterator[bool]:
    """Whether no other thread is doing work; if so, none begins until this is left."""
    with _lock:
        yield not set(_inside) - {threading.get_ident()}
