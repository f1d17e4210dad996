"""A fixed list of kernel launches, recorded once and replayed every step."""

from __future__ import annotations

import contextlib
import functools
import itertools
import os
import queue
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

from warpsplat.kernel_cache import load

PIECES_PER_THREAD = 4
"""A split launch is cut finer than there are threads, so that uneven pieces balance."""


THREADS_PER_CORE = 8
"""Most threads that a split launch is cut for: more only wait, and cost memory for pieces and stacks."""


def available_cores() -> int:
    """CPU cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # macOS, Windows
        return os.cpu_count() or 1


class _Request:
    """Work for one helper, and what became of it."""

    def __init__(self, work: Callable[[], None]) -> None:
        self.work = work
        self.error: BaseException | None = None
        self.busy = threading.Lock()
        self.busy.acquire()

    def serve(self) -> None:
        try:
            self.work()
        except BaseException as error:  # raised again where it is waited for
            self.error = error
        finally:
            self.busy.release()

    def wait(self) -> None:
        self.busy.acquire()
        if self.error:
            raise self.error


class _Helpers:
    """Threads beside the caller's, fewer than asked for where no more can be started.

    A split launch takes some hundred microseconds and a step has twenty: a queue and a lock wake a thread in
    half the time of an executor and its futures, which is a tenth of a step.
    """

    def __init__(self, count: int) -> None:
        self.requests: queue.SimpleQueue[_Request] = queue.SimpleQueue()
        self.count = 0
        with contextlib.suppress(RuntimeError):
            for _ in range(count):
                threading.Thread(target=self._serve, name="warpsplat", daemon=True).start()
                self.count += 1

    def _serve(self) -> None:
        while True:
            self.requests.get().serve()

    def ask(self, work: Callable[[], None]) -> _Request:
        request = _Request(work)
        self.requests.put(request)
        return request


@functools.cache
def _helpers(threads: int) -> _Helpers:
    """Kept for the next program."""
    return _Helpers(threads - 1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)  # threads do not survive a fork


@dataclass(frozen=True)
class Launch:
    """One kernel or host function, as the pieces that may run at the same time."""

    stage: str
    name: str
    """Of the kernel or function."""
    pieces: tuple[Callable[[], None], ...]


class Program:
    """Launches in order. On a CPU with several threads, a split launch runs as pieces of its range.

    Warp runs a CPU launch on one thread but releases the interpreter lock, and every kernel here takes the
    index of its first thread and writes only its own elements, so pieces may run at the same time and the
    result does not depend on how many there are. Not copied: arrays are those given when recorded.
    """

    def __init__(self, device: wp.Device, threads: int | None = None) -> None:
        """``threads``: of a CPU; default all, eight a core at most.

        Where no thread can be started, the caller's does the work.
        """
        self.device = device
        self.launches: list[Launch] = []
        # Recorded launches hold addresses only.
        self._arrays: list[tuple[Sequence[Any], Sequence[Any]]] = []
        self.stage = ""
        """Names what is added from now on, for ``run_timed``."""
        most = THREADS_PER_CORE * available_cores()
        self.threads = max(1, min(threads or available_cores(), most)) if device.is_cpu else 1
        """CPU threads that share a split launch."""

    def add(
        self,
        kernel: wp.Kernel,
        dim: int | tuple[int, ...],
        inputs: Sequence[Any],
        outputs: Sequence[Any],
        *,
        split: bool = False,
    ) -> None:
        """Append a launch; ``inputs`` without the kernel's leading ``first``. An empty range is left out."""
        shape = (dim,) if isinstance(dim, int) else tuple(dim)
        if min(shape) == 0:
            return
        load(kernel, self.device)
        count = self.threads * PIECES_PER_THREAD if split and self.threads > 1 else 1
        count = min(count, shape[0])
        borders = [shape[0] * i // count for i in range(count + 1)]
        self._arrays.append((inputs, outputs))
        pieces: list[Callable[[], None]] = []
        for start, stop in itertools.pairwise(borders):
            command = wp.launch(
                kernel,
                dim=(stop - start, *shape[1:]),
                inputs=[start, *inputs],
                outputs=list(outputs),
                device=self.device,
                record_cmd=True,
            )
            assert command is not None
            pieces.append(command.launch)
        self.launches.append(Launch(self.stage, kernel.key, tuple(pieces)))

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Append a host function that launches device work (a scan, a sort)."""
        self.launches.append(Launch(self.stage, function.__name__, (lambda: function(*arguments),)))

    def _replay(self, launch: Launch) -> None:
        pieces = iter(launch.pieces)

        def work() -> None:
            # Taking from a shared iterator is atomic: who is done with a piece takes the next.
            for piece in pieces:
                piece()

        requests: list[_Request] = []
        if len(launch.pieces) > 1:
            helpers = _helpers(self.threads)
            requests = [helpers.ask(work) for _ in range(min(helpers.count, len(launch.pieces) - 1))]
        try:
            work()
        finally:  # an interruption must not free arrays that helpers still write
            for request in requests:
                request.wait()

    def run(self) -> None:
        """Replay all launches."""
        for launch in self.launches:
            self._replay(launch)

    def run_timed(self) -> dict[tuple[str, str], float]:
        """Replay all launches, waiting for the device after each; seconds by stage and name."""
        seconds: dict[tuple[str, str], float] = {}
        for launch in self.launches:
            begin = time.perf_counter()
            self._replay(launch)
            wp.synchronize_device(self.device)
            spent = time.perf_counter() - begin
            key = (launch.stage, launch.name)
            seconds[key] = seconds.get(key, 0.0) + spent
        return seconds


def capture(device: wp.Device, programs: Sequence[Program]) -> wp.Graph | None:
    """One graph that replays ``programs`` without Python in between; None where that is not possible.

    A CPU graph runs on one thread, so several threads are not given up for it; a GPU needs its memory pool,
    as scans and sorts take their scratch memory from it.
    """
    if device.is_cpu:
        if any(program.threads > 1 for program in programs):
            return None
    elif not wp.is_mempool_enabled(device):
        return None
    with wp.ScopedCapture(device) as captured:
        for program in programs:
            program.run()
    return captured.graph
