"""The device that a public function computes on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from warpsplat.errors import UsageError, shown
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.device_lock import device_lock


@contextmanager
def backend_on(device: str, threads: int | None) -> Iterator[Backend]:
    """Hold the device, and return its backend.

    Raises:
        UsageError: no such device, or number of threads.
    """
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, int) or threads < 1):
        raise UsageError(f"threads must be a whole number from 1, not {shown(threads)}")
    start_warp()
    backend = Backend.on(choose_device(device), threads)
    with device_lock(backend.device):
        yield backend
