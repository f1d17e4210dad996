"""The executor of a cluster, with an imitation of Ray in this process."""

from __future__ import annotations

import logging
import signal
import socket
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.batch.executors.fake_ray import FakeRay
from tests.batch.helpers import make_tasks
from warpsplat.batch.executors import ray as module
from warpsplat.batch.executors import ray_connection, ray_worker, work, workers
from warpsplat.batch.executors.local import Serial
from warpsplat.batch.executors.ray import RayCluster
from warpsplat.batch.executors.ray_worker import TaskResources
from warpsplat.batch.executors.tasks import OnProgress, Outcome, Stop, Task
from warpsplat.errors import ResourceError, UsageError
from warpsplat.fit.settings import make_settings

SETTINGS = make_settings("draft", curves=4, iterations=4)

MADE = dict.fromkeys(range(6), "made")


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """Two nodes of one core."""
    fake = FakeRay({"CPU": 1}, {"CPU": 1})
    monkeypatch.setattr(ray_connection, "_answers", lambda address: address in {"auto", "local", *fake.known})
    monkeypatch.setitem(sys.modules, "ray", fake)
    return fake


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks are done without doing anything."""

    def do(task: Task, stop: Stop, on_progress: OnProgress) -> Outcome:
        return Outcome(task.number, "stopped" if stop() else "made", data=b"<svg/>")

    monkeypatch.setattr(work, "do", do)


@pytest.fixture
def tasks(tmp_path: Path) -> list[Task]:
    return make_tasks(tmp_path, 6, SETTINGS)


def run(executor: RayCluster, tasks: Iterable[Task], stop: Stop = lambda: False) -> list[Outcome]:
    with executor:
        return list(executor.run(tasks, stop, lambda number, part: None))


def statuses(outcomes: list[Outcome]) -> dict[int, str]:
    assert len({outcome.number for outcome in outcomes}) == len(outcomes)
    return {outcome.number: outcome.status for outcome in outcomes}


def test_the_bytes_of_a_run_in_this_process(ray: FakeRay, tasks: list[Task]) -> None:
    alone = [replace(task, threads=1) for task in tasks[:2]]
    with Serial() as serial:
        wanted = {o.number: o for o in serial.run(alone, lambda: False, lambda number, part: None)}
    found = run(RayCluster(), tasks[:2])
    assert statuses(found) == {0: "made", 1: "made"}
    for outcome in found:
        assert outcome.data and outcome.data == wanted[outcome.number].data
        assert outcome.key == wanted[outcome.number].key
        assert outcome.figures["psnr"] == wanted[outcome.number].figures["psnr"]
    assert not list(Path(tasks[0].output).parent.glob("*.svg")), "workers write nothing"


CPU, BOTH = {"CPU": 4.0}, {"CPU": 4.0, "GPU": 1.0}


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("node", "name", "chosen", "taken"),
    [
        (BOTH, "cuda:3", "cuda:0", (2, 0.5)),
        (BOTH, "auto", "cuda:0", (2, 0.5)),
        (CPU, "auto", "cpu", (2, 0.0)),
        (BOTH, "cpu", "cpu", (2, 0.0)),
    ],
)
def test_actors_declare_the_resources_of_their_tasks(
    ray: FakeRay, tasks: list[Task], node: dict[str, float], name: str, chosen: str, taken: tuple[int, float]
) -> None:
    ray.all, ray.free = [dict(node)], [dict(node)]
    assert statuses(run(RayCluster(gpus=0.5), [replace(t, device=name, threads=2) for t in tasks])) == MADE
    options = [(actor.options["num_cpus"], actor.options["num_gpus"]) for actor in ray.actors]
    assert options == [taken] * 2
    assert {(sent.given[0].device, sent.given[0].threads) for sent in ray.sent} == {(chosen, 2)}


@pytest.mark.usefixtures("quick")
def test_two_kinds_of_tasks_get_round_a_full_cluster(ray: FakeRay, tasks: list[Task]) -> None:
    ray.all, ray.free = [{"CPU": 1.0, "GPU": 1.0}], [{"CPU": 1.0, "GPU": 1.0}]
    mixed = [replace(task, device=("cpu", "cuda")[task.number % 2]) for task in tasks]
    assert statuses(run(RayCluster(), mixed)) == MADE


def test_capacity_of_nodes() -> None:
    assert TaskResources(2, 0.0).capacity({"CPU": 5.0}) == 2
    assert TaskResources(1, 0.4).capacity({"CPU": 8.0, "GPU": 2.0}) == 4, "no task has parts of two GPUs"
    assert TaskResources(1, 2.0).capacity({"CPU": 8.0, "GPU": 5.0}) == 2
    assert TaskResources(1, 1.0).capacity({"CPU": 8.0}) == 0


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("most", [1, None])
def test_workers_are_kept_and_ended(ray: FakeRay, tasks: list[Task], most: int | None) -> None:
    with RayCluster(workers=most) as executor:
        assert list(executor.run([], lambda: False, lambda number, part: None)) == []
        assert not ray.addresses, "without a task there is no connection"
        for _ in range(2):
            assert len(list(executor.run(tasks, lambda: False, lambda number, part: None))) == len(tasks)
        assert len(ray.actors) == (most or 2)
        assert ray.connected
    assert not ray.living()
    assert not ray.connected
    assert executor.workers == (most or 2)


@pytest.mark.usefixtures("quick")
def test_a_node_that_comes_later_is_used(
    ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PAUSE", -1.0)
    ray.all, ray.free = [{"CPU": 1.0}], [{"CPU": 1.0}]

    def grow(method: str) -> None:
        if method == "do" and len(ray.all) == 1:
            ray.all.append({"CPU": 1.0})
            ray.free.append({"CPU": 1.0})

    ray.between = grow
    assert statuses(run(RayCluster(), tasks)) == MADE
    assert len(ray.actors) == 2


# Losses.


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("times", [1, 99])
def test_a_lost_worker_costs_time_and_too_many_the_image(
    ray: FakeRay, tasks: list[Task], caplog: pytest.LogCaptureFixture, times: int
) -> None:
    ray.doom[3] = times
    found = run(RayCluster(), tasks)
    assert "3.png: its worker on" in caplog.text
    assert times - ray.doom[3] == min(times, 3)
    if times == 1:
        assert statuses(found) == MADE
        return
    assert statuses(found) == {**MADE, 3: "failed"}
    (failed,) = [outcome for outcome in found if outcome.status == "failed"]
    assert failed.error.startswith("3.png: its worker on ")
    assert failed.error.endswith("The actor died unexpectedly. (try 3 of 3)")
    assert "\n" not in failed.error


LACKING = "ModuleNotFoundError: No module named 'warpsplat'"


@pytest.mark.parametrize(
    ("times", "words", "match"),
    [
        (99, "The actor died", r"end as soon as they begin; the last was lost: The actor died"),
        (1, f"The actor died because of an error:\n  File x\n{LACKING}", f"lacks a package: {LACKING}"),
        (0, "", r"has warpsplat 0\.0\.1, here it is "),
    ],
)
def test_nodes_whose_workers_cannot_begin(
    ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch, times: int, words: str, match: str
) -> None:
    ray.doom["hello"], ray.words = times, words
    monkeypatch.setattr(ray_worker, "__version__", "0.0.1")
    with pytest.raises(ResourceError if times > 1 else UsageError, match=match):
        run(RayCluster(), tasks)
    assert not ray.sent and not ray.living() and not ray.connected


# Stopping.


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("grace", "found"), [(10.0, {0: "made", 1: "made", 2: "made"}), (-1.0, {0: "made", 1: "stopped"})]
)
def test_stop_ends_tasks_with_the_best_so_far_or_without(
    ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch, grace: float, found: dict[int, str]
) -> None:
    """Each task that was taken has an outcome."""
    monkeypatch.setattr(workers, "GRACE", grace)
    taken = []

    def source() -> Iterator[Task]:
        for task in tasks:
            taken.append(task.number)
            yield task

    assert statuses(run(RayCluster(), source(), lambda: len(taken) >= len(found))) == found
    assert taken == list(found)
    assert not ray.living()


# Connecting.


def test_without_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UsageError, match=r'pip install "warpsplat\[ray\]"'):
        RayCluster()


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("address", "variable", "known", "asked"),
    [
        ("", "", "auto", "auto"),
        ("", "", "", "auto local"),
        ("", "10.0.0.1:6379", "10.0.0.1:6379", "10.0.0.1:6379"),
        ("10.0.0.2:6379", "10.0.0.1:6379", "10.0.0.2:6379", "10.0.0.2:6379"),
        ("local", "", "auto", "local"),
        ("10.0.0.2:6379", "", "", ""),
        ("", "10.0.0.2:6379", "", ""),
        ("auto", "", "", ""),
    ],
)
def test_addresses(
    ray: FakeRay,
    tasks: list[Task],
    monkeypatch: pytest.MonkeyPatch,
    address: str,
    variable: str,
    known: str,
    asked: str,
) -> None:
    """The address that is given, else that of the variable, else a cluster here, else a new one."""
    monkeypatch.setenv("RAY_ADDRESS", variable)
    ray.known = {known}
    if asked:
        run(RayCluster(address), tasks[:1])
        assert ray.addresses == asked.split()
    else:
        with pytest.raises(UsageError, match=f"no Ray cluster answers at {address or variable}"):
            run(RayCluster(address), tasks)


def test_asks_whether_anybody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert ray_connection._answers(f"127.0.0.1:{port}")
        assert ray_connection._answers(f"ray://127.0.0.1:{port}")
    assert not ray_connection._answers(f"127.0.0.1:{port}")
    assert not ray_connection._answers("127.0.0.1:99999")
    assert ray_connection._answers("auto")


@pytest.mark.usefixtures("quick")
def test_a_connection_of_the_process_is_kept(ray: FakeRay, tasks: list[Task]) -> None:
    ray.connected = True
    run(RayCluster(), tasks)
    assert ray.connected
    assert not ray.addresses


@pytest.mark.usefixtures("quick")
def test_signal_handlers_are_kept(ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.getsignal(signal.SIGTERM)

    def init(address: str, **options: Any) -> None:
        signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(number))

    monkeypatch.setattr(ray, "init", init)
    try:
        run(RayCluster(), tasks)
        assert signal.getsignal(signal.SIGTERM) is before
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.mark.usefixtures("quick")
def test_warns_of_waiting(
    ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "PATIENCE", -1.0)
    large = [replace(task, threads=8) for task in tasks]
    polls = iter([False] * 5)
    with caplog.at_level(logging.WARNING):
        assert statuses(run(RayCluster(), large, lambda: next(polls, True))) == {0: "stopped"}
    assert caplog.text.count("no room yet for --threads 8: its 2 nodes have 2 CPUs and 0 GPUs in all") == 1


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("address", ["", "local", "elsewhere"])
def test_only_a_cluster_of_its_own_that_has_died_ends_the_run(
    ray: FakeRay, tasks: list[Task], address: str
) -> None:
    ray.known = {"elsewhere"}
    ray.all.clear()
    ray.free.clear()
    polls = iter([False] * 5)
    if address == "elsewhere":
        assert statuses(run(RayCluster(address), tasks, lambda: next(polls, True)))
    else:
        with pytest.raises(ResourceError, match="has died"):
            run(RayCluster(address), tasks, lambda: next(polls, True))
