"""CUDA as Warp and torch share it: whether torch can use a device, and in which order both work on it."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator

import torch
import warp as wp


def can_use(device: str) -> bool:
    """Return whether this torch can use a device of Warp's: one without CUDA has the CPU only."""
    wanted = torch.device(device)
    return wanted.type == "cpu" or (wanted.index or 0) < torch.cuda.device_count()


def is_capturing(device: torch.device) -> bool:
    """Return whether torch is capturing a CUDA graph on its current stream: nothing can be read back then."""
    return device.type == "cuda" and torch.cuda.is_current_stream_capturing()


@contextlib.contextmanager
def shared_stream(device: torch.device) -> Iterator[None]:
    """Have Warp and torch work on one stream: after what torch's current stream has been given so far, and
    before what it is given later. Inside of a capture they take part in it, on torch's current stream.

    The stream is Warp's. Warp frees memory on CUDA's legacy default stream, which waits for the streams that
    Warp makes, but not for those of torch, which are non-blocking: work on these might still use the memory.
    What torch allocates meanwhile belongs to the shared stream, so results are allocated before.
    """
    if device.type == "cpu":
        yield
        return
    theirs = torch.cuda.current_stream(device)
    if is_capturing(device):
        with _captured(wp.stream_from_torch(theirs)):
            yield
        return
    stream = _stream(str(wp.device_from_torch(device)))
    shared = wp.stream_to_torch(stream)
    shared.wait_stream(theirs)
    try:
        with wp.ScopedStream(stream, sync_enter=False), torch.cuda.stream(shared):
            yield
    finally:
        theirs.wait_stream(shared)


@functools.cache
def _stream(device: str) -> wp.Stream:
    return wp.Stream(device)


@contextlib.contextmanager
def _captured(stream: wp.Stream) -> Iterator[None]:
    """Have Warp work on a stream that torch captures."""
    with wp.ScopedStream(stream, sync_enter=False):  # Warp's own stream is not part of the capture
        wp.capture_begin(stream=stream, external=True)
        try:
            yield
        finally:
            wp.capture_end(stream=stream)
