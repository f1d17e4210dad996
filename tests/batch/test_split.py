"""Processes and threads of a batch."""

from __future__ import annotations

import pytest

from warpsplat.batch.executors import local
from warpsplat.batch.executors.local import MEMORY, split_cores
from warpsplat.fit.settings import Settings, make_settings

LONG, SHORT = make_settings(), make_settings(curves=4, iterations=6)


@pytest.mark.parametrize(
    ("settings", "workers", "threads", "memory", "made"),
    [
        ([LONG] * 9, None, None, 99, (8, 1)),
        ([LONG] * 3, None, None, 99, (3, 2)),
        ([LONG], None, None, 99, (1, 8)),
        ([SHORT] * 9, None, None, 99, (1, 8)),
        ([LONG] * 9, None, 4, 99, (2, 4)),
        ([LONG] * 9, None, 16, 99, (1, 16)),
        ([LONG] * 9, 4, None, 99, (4, 2)),
        ([LONG] * 9, 20, None, 99, (20, 1)),
        ([LONG] * 9, 4, 4, 99, (4, 4)),
        ([LONG] * 9, None, None, 2, (2, 4)),
        ([LONG] * 9, None, None, 0, (1, 8)),
        ([], None, None, 99, (1, 8)),
    ],
)
def test_cores_are_shared(
    monkeypatch: pytest.MonkeyPatch,
    settings: list[Settings],
    workers: int | None,
    threads: int | None,
    memory: int,
    made: tuple[int, int],
) -> None:
    monkeypatch.setattr(local, "available_cores", lambda: 8)
    monkeypatch.setattr(local, "free_memory", lambda: memory * MEMORY)
    assert split_cores(settings, workers, threads, on_cpu=True) == made


def test_a_gpu_is_not_shared() -> None:
    assert split_cores([LONG] * 9, None, None, on_cpu=False) == (1, None)
    assert split_cores([LONG] * 9, 2, None, on_cpu=False) == (2, None)
