"""How many processes a batch has, and how many threads each."""

from __future__ import annotations

from collections.abc import Iterable

from warpsplat.fit.settings import Settings
from warpsplat.native import available_cores, free_memory

WORTH = 400_000
"""Shapes times steps of a batch from which processes save more than the seconds that they take to start."""

MEMORY = 1 << 30
"""What a process has room for, where their number is not given [bytes]: an image of 10 million pixels."""


def divided(
    settings: Iterable[Settings], workers: int | None, threads: int | None, *, on_cpu: bool
) -> tuple[int, int | None]:
    """Workers, and threads of each.

    A process a core, each with one thread, does more than one process with all threads: what is not split
    among threads (reading, scoring, writing, surgery) is done at the same time as well. On a GPU they would
    share the one device.

    Args:
        settings: of each image.
        workers: as given; None: chosen.
        threads: as given; None: the cores are shared.
        on_cpu: whether that is where images are done.
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
