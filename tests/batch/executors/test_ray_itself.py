"""The executor of a cluster with Ray itself, where that is installed: a cluster of this machine alone."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from warpsplat.batch.executors.local import Serial
from warpsplat.batch.executors.ray import RayCluster
from warpsplat.batch.executors.tasks import Executor, Outcome, Task
from warpsplat.fit.settings import make_settings

pytest.importorskip("ray")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("default"),  # Ray's own
]


def tasks(folder: Path) -> Iterator[Task]:
    rng = np.random.default_rng(0)
    settings = make_settings("draft", curves=4, iterations=8)
    for i in range(4):
        path = folder / f"{i}.png"
        Image.fromarray(rng.integers(0, 255, (24, 32, 3), dtype=np.uint8)).save(path)
        yield Task(i, "key", path.read_bytes(), path.name, f"{i}.svg", settings, "cpu", 1)


def results(executor: Executor, folder: Path) -> dict[int, bytes | None]:
    with executor:
        found: list[Outcome] = list(executor.run(tasks(folder), lambda: False, lambda number, part: None))
    assert len(found) == 4
    return {outcome.number: outcome.data for outcome in found}


def test_the_bytes_of_a_run_in_this_process(tmp_path: Path) -> None:
    wanted = results(Serial(), tmp_path)
    assert all(wanted.values())
    handler = signal.getsignal(signal.SIGTERM)
    assert results(RayCluster("local"), tmp_path) == wanted
    assert signal.getsignal(signal.SIGTERM) is handler
