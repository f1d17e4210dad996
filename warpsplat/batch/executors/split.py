"""Choose the processes of a batch, and the threads of each."""

from __future__ import annotations

from collections.abc import Iterable

from warpsplat.fit.settings import Settings
from warpsplat.native import available_cores, free_memory

WORTH = 400_000
"""Shapes times steps of a batch above which several processes save more time than they take to start."""

MEMORY = 1 << 30
"""Memory to allow for a process [bytes]: an image of 10 million pixels."""


def divided(
    settings: Iterable[Settings], workers: int | None, threads: int | None, *, on_cpu: bool
) -> tuple[int, int | None]:
    """Return the number of workers, and the threads of each.

    One process a core with one thread each is faster than one process with all threads, because what has a
    single thread (reading, scoring, writing, surgery) is parallel too. On a GPU they would share one device.

    Args:
        settings: of each image.
        workers: as given; None: chosen.
        threads: as given; None: the cores are shared.
        on_cpu: whether images are done on the CPU.
    """
    cores = available_cores()
    if workers is None:
        efforts = [one.curves * one.iterations for one in settings]
        workers = 1
        if on_cpu and sum(efforts) >= WORTH:
            free = free_memory()
            room = cores if free is None else free // MEMORY
            workers = max(1, min(cores // (threads or 1), len(efforts), room))
    return workers, threads if threads or not on_cpu else max(1, cores // workers)
