"""Which threads may use Warp at the same time.

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
_working: list[int] = []
"""Threads within a ``device_lock``, an entry for each level of nesting."""


@contextlib.contextmanager
def device_lock(device: wp.Device) -> Iterator[None]:
    """Work on ``device``: on a GPU alone, on a CPU beside other threads. May be nested."""
    with _gpu_lock(str(device)) if device.is_cuda else contextlib.nullcontext():
        me = threading.get_ident()
        with _lock:
            _working.append(me)
        try:
            yield
        finally:
            with _lock:
                _working.remove(me)


@functools.cache
def _gpu_lock(device: str) -> threading.RLock:
    return threading.RLock()


@contextlib.contextmanager
def exclusive() -> Iterator[bool]:
    """Yield whether no other thread is within a ``device_lock``; none enters one until this is left."""
    with _lock:
        yield not set(_working) - {threading.get_ident()}
