"""The executor of a cluster with Ray itself, where that is installed: a cluster of this machine alone."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.batch.helpers import make_tasks
from warpsplat.batch.executors.local import Serial
from warpsplat.batch.executors.ray import RayCluster
from warpsplat.batch.executors.tasks import Executor, Outcome
from warpsplat.fit.settings import make_settings

pytest.importorskip("ray")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("default"),  # Ray's own
]


def results(executor: Executor, folder: Path) -> dict[int, bytes | None]:
    tasks = make_tasks(folder, 4, make_settings("draft", curves=4, iterations=8), 1)
    with executor:
        found: list[Outcome] = list(executor.run(tasks, lambda: False, lambda number, part: None))
    assert len(found) == 4
    return {outcome.number: outcome.data for outcome in found}


def test_the_bytes_of_a_run_in_this_process(tmp_path: Path) -> None:
    wanted = results(Serial(), tmp_path)
    assert all(wanted.values())
    handler = signal.getsignal(signal.SIGTERM)
    assert results(RayCluster("local"), tmp_path) == wanted
    assert signal.getsignal(signal.SIGTERM) is handler
