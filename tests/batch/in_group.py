"""Run a batch as the first of a process group, and say which images are under way.

``python -m tests.batch.in_group METHOD ARGUMENT...``: how processes are started, and the command line.
"""

from __future__ import annotations

import multiprocessing
import os
import sys

from warpsplat.batch.display import BatchDisplay
from warpsplat.batch.executors import pool
from warpsplat.cli.main import main


class Display(BatchDisplay):
    def on_progress(self, number: int, fraction: float) -> None:
        super().on_progress(number, fraction)
        if fraction:
            print(f"under way: {number}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    pool.CONTEXT = multiprocessing.get_context(sys.argv[1])  # type: ignore[assignment]
    assert os.getpgrp() == os.getpid(), "signals must not reach other programs"
    sys.modules[BatchDisplay.__module__].BatchDisplay = Display  # type: ignore[attr-defined]
    main(sys.argv[2:])
