"""Failures of a device while it works, as Warp raises them."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator

import warp as wp

from warpsplat.errors import DeviceError
from warpsplat.native import free_memory
from warpsplat.rendering.cuda import OUT_OF_MEMORY, called, cuda_error
from warpsplat.rendering.device import note_failure
from warpsplat.rendering.memory import in_words

ALLOCATION = re.compile(r"Failed to allocate (\d+) bytes")


@contextlib.contextmanager
def failures_of(device: wp.Device) -> Iterator[None]:
    """Raise failures of ``device`` as what they mean to people.

    Raises:
        DeviceError: it failed, or has not enough memory.
    """
    try:
        yield
    except RuntimeError as error:
        lacking, (code, cause) = ALLOCATION.search(str(error)), cuda_error(str(error))
        if lacking and device.is_cuda:
            code, cause = cuda_error()  # after another failure all allocations fail
        if code == OUT_OF_MEMORY or (lacking and not code):
            raise DeviceError(_lack(device, int(lacking[1]) if lacking else None)) from error
        if not code:
            raise
        note_failure(device, cause)
        lost = DeviceError(f"{called(device)} failed: {cause} (CUDA error {code})")
        lost.is_lost = True
        raise lost from error


def _lack(device: wp.Device, wanted: int | None) -> str:
    """Return what to say of a lack of memory, where ``wanted`` bytes were asked for."""
    free = free_memory() if device.is_cpu else device.free_memory
    there = "" if free is None else f", {in_words(free)} are free"
    asked = "" if wanted is None else f": {in_words(wanted)} more are needed{there}"
    place = "" if device.is_cpu else f" on {called(device)}"
    hint = "fewer shapes (--curves) or a smaller image (--max-memory) take less"
    elsewhere = "" if device.is_cpu else ", --device cpu takes none of it"
    return f"not enough memory{place}{asked}; {hint}{elsewhere}"
