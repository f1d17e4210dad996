"""Worker processes: how many, kept, replaced when they die, and gone when the batch is."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.batch import stub
from warpsplat.batch.executors import local, pool, workers
from warpsplat.batch.executors.local import MEMORY, split_cores
from warpsplat.batch.executors.pool import Pool
from warpsplat.batch.executors.tasks import Outcome, Task
from warpsplat.errors import ResourceError
from warpsplat.fit.settings import Settings, make_settings


@pytest.fixture(autouse=True)
def stubbed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(pool, "do_tasks", stub.main)
    yield
    assert not multiprocessing.active_children(), "no process is left"


def tasks(folder: Path, *names: str) -> list[Task]:
    return [Task(i, "key", b"", name, str(folder / f"{i}.svg"), Settings()) for i, name in enumerate(names)]


def never() -> bool:
    return False


def ignored(number: int, part: float) -> None:
    pass


def outcomes(todo: list[Task]) -> list[Outcome]:
    with Pool(1) as used:
        return sorted(used.run(todo, never, ignored), key=lambda outcome: outcome.number)


def test_workers_are_kept_and_their_notices_heard(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with Pool(1) as used, caplog.at_level("WARNING", logger="warpsplat"):
        first = list(used.run(tasks(tmp_path, "a", "notice"), never, ignored))
        second = list(used.run(tasks(tmp_path, "c"), never, ignored))
    assert [outcome.status for outcome in first + second] == ["made"] * 3
    assert len({outcome.figures["process"] for outcome in first + second}) == 1
    assert "a notice" in caplog.text


def test_an_image_fails_if_its_worker_dies_twice(tmp_path: Path) -> None:
    found = outcomes(tasks(tmp_path, "die once", "die", "a"))
    assert [outcome.status for outcome in found] == ["made", "failed", "made"]
    assert found[1].error.startswith("die: its worker process was killed (SIGKILL")


def test_workers_that_never_begin_end_the_batch(tmp_path: Path) -> None:
    with pytest.raises(ResourceError, match="end as soon as they begin"):
        outcomes(tasks(tmp_path, *["stillborn"] * 4))


def test_no_more_is_taken_than_there_are_workers_and_nothing_after_a_stop(tmp_path: Path) -> None:
    """Tasks in progress end by themselves."""
    taken: list[int] = []
    begun: list[int] = []

    def drawn() -> Iterator[Task]:
        for task in tasks(tmp_path, "wait", "wait", "wait"):
            taken.append(task.number)
            yield task

    def advance(number: int, part: float) -> None:
        begun.append(number)

    with Pool(2) as used:
        found = list(used.run(drawn(), lambda: len(begun) == 2, advance))
    assert taken == [0, 1]
    assert sorted((outcome.number, outcome.status) for outcome in found) == [(0, "stopped"), (1, "stopped")]


def test_a_worker_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "GRACE", 0.1)
    begun: list[int] = []
    with Pool(1) as used:
        run = used.run(tasks(tmp_path, "hang"), lambda: bool(begun), lambda n, part: begun.append(n))
        assert [(o.status, o.data) for o in run] == [("stopped", None)]


def test_an_error_in_the_middle_leaves_no_process(tmp_path: Path) -> None:
    def fail(number: int, part: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Pool(2) as used:
        list(used.run(tasks(tmp_path, "hang", "hang"), never, fail))


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
