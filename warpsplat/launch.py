"""A fixed list of kernel launches, recorded once and replayed every step."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import warp as wp

PIECES_PER_THREAD = 4
"""A split launch is cut finer than there are threads, so that uneven pieces balance."""


class Program:
    """Launches in order. On a CPU with several threads, a split launch runs as pieces of its range.

    Warp runs a CPU launch on one thread but releases the interpreter lock, and every kernel here takes the
    index of its first thread and writes only its own elements, so pieces may run at the same time and the
    result does not depend on how many there are. Not copied: arrays are those given when recorded.
    """

    def __init__(self, device: wp.Device, threads: int | None = None) -> None:
        self.device = device
        self._stages: list[list[Callable[[], None]]] = []
        self._threads = max(1, threads or os.cpu_count() or 1) if device.is_cpu else 1
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None

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
        pieces = self._threads * PIECES_PER_THREAD if split and self._pool else 1
        pieces = min(pieces, shape[0])
        borders = [shape[0] * i // pieces for i in range(pieces + 1)]
        stage: list[Callable[[], None]] = []
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
            stage.append(command.launch)
        self._stages.append(stage)

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Append a host function that launches device work (a scan, a sort)."""
        self._stages.append([lambda: function(*arguments)])

    def run(self) -> None:
        """Replay all launches."""
        for stage in self._stages:
            if len(stage) == 1 or self._pool is None:
                for launch in stage:
                    launch()
            else:
                for future in [self._pool.submit(launch) for launch in stage]:
                    future.result()

    def close(self) -> None:
        """End the threads."""
        if self._pool:
            self._pool.shutdown(wait=False)
