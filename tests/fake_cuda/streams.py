"""Streams, events and captures: what waits for what.

Work is numbered as it is submitted. A stream does its work in that order, and only when something waits for
it. The work of the legacy default stream waits for what blocking streams were given before, and theirs for
its (CUDA Runtime API, "Stream synchronization behavior"). A stream that waits for an event waits for what the
other stream had been given when it was recorded. What a capture forbids: CUDA Programming Guide, "Prohibited
and Unhandled Operations".
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from tests.fake_cuda.memory import Region
from tests.fake_cuda.rules import report

Work = Callable[[], None]

CAPTURE_UNSUPPORTED, CAPTURE_INVALIDATED, CAPTURE_IMPLICIT = 900, 901, 906
ILLEGAL_ADDRESS, LAUNCH_FAILURE, INVALID_VALUE, OUT_OF_MEMORY, INVALID_IMAGE = 700, 719, 1, 2, 200
"""CUDA's error codes."""

WORDS = {
    INVALID_VALUE: "invalid argument",
    OUT_OF_MEMORY: "out of memory",
    INVALID_IMAGE: "device kernel image is invalid",
    ILLEGAL_ADDRESS: "an illegal memory access was encountered",
    LAUNCH_FAILURE: "unspecified launch failure",
    CAPTURE_UNSUPPORTED: "operation not permitted when stream is capturing",
    CAPTURE_INVALIDATED: "operation failed due to a previous error during capture",
    CAPTURE_IMPLICIT: "operation would make the legacy stream depend on a capturing blocking stream",
}


class CudaError(Exception):
    """An error that a function of CUDA returns."""

    def __init__(self, code: int) -> None:
        super().__init__(WORDS[code])
        self.code = code


@dataclass
class Capture:
    """Work that a stream records instead of doing it."""

    id: int
    work: list[Work] = field(default_factory=list)
    invalid: bool = False


@dataclass
class Stream:
    """A queue of numbered work; handle 0 is the legacy default stream of its device."""

    handle: int
    device: int
    blocking: bool = True
    """Whether it and the legacy stream wait for each other."""
    queue: deque[tuple[int, Work]] = field(default_factory=deque)
    capture: Capture | None = None


@dataclass
class Event:
    """A point in the work of a stream."""

    stream: Stream | None = None
    number: int = 0


class Machine:
    """All streams of a process."""

    def __init__(self, devices: int) -> None:
        self.region = Region()
        self.handles = itertools.count(0x7000, 16)
        self.numbers = itertools.count(1)
        self.legacy = [Stream(0, device) for device in range(devices)]
        self.streams: dict[int, Stream] = {}
        self.captures: dict[int, Capture] = {}
        self.failed: int = 0
        """Code of an error after which a context is of no use."""

    def all(self) -> list[Stream]:
        """Return all streams."""
        return [*self.legacy, *self.streams.values()]

    def new_stream(self, device: int, blocking: bool = True) -> Stream:
        """Make a stream."""
        stream = Stream(next(self.handles), device, blocking)
        self.streams[stream.handle] = stream
        return stream

    def now(self) -> int:
        """Return the number of the latest work."""
        return next(self.numbers) - 1

    def submit(self, stream: Stream, work: Work) -> None:
        """Give a stream work, to do or to record."""
        self.check_context()
        if stream.capture:
            if stream.capture.invalid:
                raise CudaError(CAPTURE_INVALIDATED)
            stream.capture.work.append(work)
            return
        self.check_legacy(stream)
        stream.queue.append((next(self.numbers), work))

    def check_context(self) -> None:
        """Raise the error that ended the context, if one did."""
        if self.failed:
            raise CudaError(self.failed)

    def check_legacy(self, stream: Stream) -> None:
        """Refuse the legacy stream while a blocking stream is capturing."""
        if stream.handle == 0 and any(other.capture and other.blocking for other in self.streams.values()):
            self.invalidate(CAPTURE_IMPLICIT)

    def invalidate(self, code: int) -> None:
        """Make all captures invalid and fail."""
        for capture in self.captures.values():
            capture.invalid = True
        raise CudaError(code)

    def wait_for(self, stream: Stream, number: int) -> None:
        """Do the work of a stream up to a number, with what it waits for."""
        while stream.queue and stream.queue[0][0] <= number:
            at, work = stream.queue.popleft()
            others = self.all() if stream.handle == 0 else [self.legacy[stream.device]]
            for other in others:
                if (
                    stream.blocking
                    and other.blocking
                    and other.device == stream.device
                    and other is not stream
                ):
                    self.wait_for(other, at - 1)
            if not self.failed:
                work()

    def finish(self, stream: Stream) -> None:
        """Wait for all work of a stream."""
        self.check_context()
        if stream.capture:
            self.invalidate(CAPTURE_UNSUPPORTED)
        self.check_legacy(stream)
        self.wait_for(stream, self.now())
        if stream.handle == 0:
            self.finish_all(stream.device)
        self.check_context()

    def finish_all(self, device: int) -> None:
        """Wait for all work of a device."""
        for stream in self.all():
            if stream.device == device:
                self.wait_for(stream, self.now())

    def let_wait(self, stream: Stream, event: Event) -> None:
        """Make the later work of a stream wait for an event."""
        source = event.stream
        if source is None or source is stream:
            return
        if source.capture and source.capture is not stream.capture:
            if stream.handle == 0:
                self.invalidate(CAPTURE_IMPLICIT)
            report("a fork in a capture, which the test device does not know")
        if (
            stream.capture and not source.capture
        ):  # cudaErrorStreamCaptureIsolation, but for what is done by now
            return
        number = event.number
        self.submit(stream, lambda: self.wait_for(source, number))
