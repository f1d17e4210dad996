"""Run a pool, or a batch, as the first of a process group, and say what happens to it.

``python -m tests.batch.in_group METHOD``: stub tasks, one of which signals to the whole group.
``python -m tests.batch.in_group METHOD ARGUMENT...``: the command line; says which images are under way.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import sys

from tests.batch import stub
from warpsplat.batch.executors import pool
from warpsplat.batch.executors.tasks import Task
from warpsplat.fit.settings import Settings


def run_stubs() -> None:
    """Send both signals as soon as a worker is started, and from the first task; print the outcomes."""
    pool.do_tasks = stub.main
    received: list[int] = []
    for number in stub.SIGNALS:
        signal.signal(number, lambda number, _: received.append(number))
    used = pool.Pool(2)
    with used:

        def stop() -> bool:
            if used._busy() and not received:
                stub.signal_group()
            return False

        names = ("signal group", "a", "a")
        tasks = [Task(i, "key", b"", name, f"{i}.svg", Settings()) for i, name in enumerate(names)]
        found = [outcome.figures for outcome in used.run(tasks, stop, lambda number, part: None)]
    print(json.dumps({"figures": found, "received": sorted(received)}))


def run_command(arguments: list[str]) -> None:
    """Run the command line."""
    from warpsplat.batch.display import BatchDisplay
    from warpsplat.cli.main import main

    class Display(BatchDisplay):
        def on_progress(self, number: int, fraction: float) -> None:
            super().on_progress(number, fraction)
            if fraction:
                print(f"under way: {number}", file=sys.stderr, flush=True)

    sys.modules[BatchDisplay.__module__].BatchDisplay = Display  # type: ignore[attr-defined]
    main(arguments)


if __name__ == "__main__":
    pool.CONTEXT = multiprocessing.get_context(sys.argv[1])  # type: ignore[assignment]
    assert os.getpgrp() == os.getpid(), "signals must not reach other programs"
    run_command(sys.argv[2:]) if len(sys.argv) > 2 else run_stubs()
