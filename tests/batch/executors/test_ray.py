"""The executor of a cluster, with a Ray that is played in this process."""

from __future__ import annotations

import logging
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.batch.executors.fake_ray import FakeRay
from warpsplat.batch.executors import ray as module
from warpsplat.batch.executors import ray_connection, ray_worker, work
from warpsplat.batch.executors.local import Serial
from warpsplat.batch.executors.ray import TRIES, RayCluster
from warpsplat.batch.executors.ray_worker import TaskResources
from warpsplat.batch.executors.tasks import Outcome, Stop, Task
from warpsplat.errors import ResourceError, UsageError
from warpsplat.fit.settings import make_settings

SETTINGS = make_settings("draft", curves=4, iterations=4)


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

    def do(task: Task, stop: Stop, report: Callable[[int, float], None]) -> Outcome:
        return Outcome(task.number, "stopped" if stop() else "made", data=b"<svg/>")

    monkeypatch.setattr(work, "do", do)


@pytest.fixture
def tasks(tmp_path: Path) -> list[Task]:
    rng = np.random.default_rng(0)
    found = []
    for i in range(6):
        path = tmp_path / f"{i}.png"
        Image.fromarray(rng.integers(0, 255, (24, 32, 3), dtype=np.uint8)).save(path)
        found.append(
            Task(i, "key", path.read_bytes(), path.name, str(tmp_path / f"{i}.svg"), SETTINGS, "cpu")
        )
    return found


def run(
    executor: RayCluster, tasks: Iterator[Task] | Sequence[Task], stop: Stop = lambda: False
) -> list[Outcome]:
    with executor:
        return list(executor.run(iter(tasks), stop, lambda number, part: None))


def statuses(outcomes: list[Outcome]) -> dict[int, str]:
    assert len({outcome.number for outcome in outcomes}) == len(outcomes)
    return {outcome.number: outcome.status for outcome in outcomes}


def test_the_bytes_of_a_run_in_this_process(ray: FakeRay, tasks: list[Task]) -> None:
    alone = [replace(task, bring=True, threads=1) for task in tasks[:2]]
    with Serial() as serial:
        wanted = {o.number: o for o in serial.run(alone, lambda: False, lambda number, part: None)}
    found = run(RayCluster(), tasks[:2])
    assert statuses(found) == {0: "made", 1: "made"}
    for outcome in found:
        assert outcome.data and outcome.data == wanted[outcome.number].data
        assert (outcome.key, outcome.digest) == (wanted[outcome.number].key, wanted[outcome.number].digest)
        assert outcome.figures["psnr"] == wanted[outcome.number].figures["psnr"]
    assert not list(Path(tasks[0].output).parent.glob("*.svg")), "workers write nothing"


@pytest.mark.usefixtures("quick")
def test_declares_what_tasks_take(ray: FakeRay, tasks: list[Task]) -> None:
    ray.all = ray.free = [{"CPU": 4.0, "GPU": 1.0}]
    gpu = [replace(task, device="cuda:3", threads=2) for task in tasks]
    assert set(statuses(run(RayCluster(gpus=0.5), gpu)).values()) == {"made"}
    assert {(actor.options["num_cpus"], actor.options["num_gpus"]) for actor in ray.actors} == {(2, 0.5)}
    assert len(ray.actors) == 2
    sent = ray.sent[0].given[0]
    assert (sent.device, sent.threads, sent.bring) == ("cuda:0", 2, True), "a worker has no other GPU"


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(("node", "chosen"), [({"CPU": 2.0}, "cpu"), ({"CPU": 2.0, "GPU": 1.0}, "cuda:0")])
def test_auto_is_a_gpu_where_there_are_any(
    ray: FakeRay, tasks: list[Task], node: dict[str, float], chosen: str
) -> None:
    ray.all, ray.free = [dict(node)], [dict(node)]
    run(RayCluster(), [replace(task, device="auto") for task in tasks])
    assert {sent.given[0].device for sent in ray.sent} == {chosen}


@pytest.mark.usefixtures("quick")
def test_two_kinds_of_tasks_get_round_a_full_cluster(ray: FakeRay, tasks: list[Task]) -> None:
    ray.all, ray.free = [{"CPU": 1.0, "GPU": 1.0}], [{"CPU": 1.0, "GPU": 1.0}]
    mixed = [replace(task, device=("cpu", "cuda")[task.number % 2]) for task in tasks]
    assert statuses(run(RayCluster(), mixed)) == dict.fromkeys(range(6), "made")


def test_room_of_nodes() -> None:
    assert TaskResources(2, 0.0).capacity({"CPU": 5.0}) == 2
    assert TaskResources(1, 0.4).capacity({"CPU": 8.0, "GPU": 2.0}) == 4, "no task has parts of two GPUs"
    assert TaskResources(1, 2.0).capacity({"CPU": 8.0, "GPU": 5.0}) == 2
    assert TaskResources(1, 1.0).capacity({"CPU": 8.0}) == 0


@pytest.mark.usefixtures("quick")
def test_takes_no_more_than_are_in_work_and_one(ray: FakeRay, tasks: list[Task]) -> None:
    taken = ended = 0
    most = 0

    def source() -> Iterator[Task]:
        nonlocal taken, most
        for task in tasks:
            taken += 1
            most = max(most, taken - ended)
            yield task

    with RayCluster() as executor:
        for _ in executor.run(source(), lambda: False, lambda number, part: None):
            ended += 1
    assert taken == ended == len(tasks)
    assert most == 2


@pytest.mark.usefixtures("quick")
def test_workers_are_kept_and_ended(ray: FakeRay, tasks: list[Task]) -> None:
    with RayCluster() as executor:
        for _ in range(2):
            assert len(list(executor.run(tasks, lambda: False, lambda number, part: None))) == len(tasks)
        assert len(ray.actors) == 2
        assert ray.connected
    assert not ray.living()
    assert not ray.connected
    assert executor.workers == 2


@pytest.mark.usefixtures("quick")
def test_no_task_no_cluster(ray: FakeRay) -> None:
    assert run(RayCluster(), []) == []
    assert not ray.addresses


@pytest.mark.usefixtures("quick")
def test_at_most_as_many_as_asked_for(ray: FakeRay, tasks: list[Task]) -> None:
    run(RayCluster(workers=1), tasks)
    assert len(ray.actors) == 1


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
    assert len(run(RayCluster(), tasks)) == len(tasks)
    assert len(ray.actors) == 2


# Losses.


@pytest.mark.usefixtures("quick")
def test_a_lost_worker_costs_time_only(
    ray: FakeRay, tasks: list[Task], caplog: pytest.LogCaptureFixture
) -> None:
    ray.doom[3] = 1
    executor = RayCluster()
    assert statuses(run(executor, tasks)) == dict.fromkeys(range(6), "made")
    assert executor.lost == 1
    assert "3.png: its worker on" in caplog.text
    assert "(1 so far)" in caplog.text


@pytest.mark.usefixtures("quick")
def test_an_image_that_kills_workers_fails_alone(ray: FakeRay, tasks: list[Task]) -> None:
    ray.doom[3] = 99
    found = run(RayCluster(), tasks)
    assert statuses(found) == {**dict.fromkeys(range(6), "made"), 3: "failed"}
    (failed,) = [outcome for outcome in found if outcome.status == "failed"]
    assert failed.error.startswith("3.png: its worker on ")
    assert failed.error.endswith("The actor died unexpectedly.")
    assert "\n" not in failed.error
    assert 99 - ray.doom[3] == TRIES


@pytest.mark.usefixtures("quick")
def test_workers_that_cannot_begin_are_an_error(ray: FakeRay, tasks: list[Task]) -> None:
    ray.doom["hello"] = 99
    with pytest.raises(ResourceError, match=r"end as soon as they begin: The actor died"):
        run(RayCluster(), tasks)
    assert not ray.living()
    assert not ray.connected


def test_a_node_without_the_package(ray: FakeRay, tasks: list[Task]) -> None:
    ray.doom["hello"] = 1
    ray.words = (
        "The actor died because of an error:\n  File x\nModuleNotFoundError: No module named 'warpsplat'"
    )
    with pytest.raises(
        UsageError, match=r"lacks a package: ModuleNotFoundError: No module named 'warpsplat'"
    ):
        run(RayCluster(), tasks)


def test_a_node_of_another_version(ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_worker, "__version__", "0.0.1")
    with pytest.raises(UsageError, match=r"has warpsplat 0\.0\.1, here it is "):
        run(RayCluster(), tasks)
    assert not ray.sent


# Stopping.


@pytest.mark.usefixtures("quick")
def test_stop_ends_tasks_with_the_best_so_far(ray: FakeRay, tasks: list[Task]) -> None:
    stopped = False
    taken = []

    def source() -> Iterator[Task]:
        nonlocal stopped
        for task in tasks:
            taken.append(task.number)
            stopped = len(taken) == 3
            yield task

    found = run(RayCluster(), source(), lambda: stopped)
    assert {outcome.number for outcome in found} == set(taken), "an outcome for each that was taken"
    assert taken == [0, 1, 2]
    assert not ray.living()


@pytest.mark.usefixtures("quick")
def test_what_does_not_end_is_ended(ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "GRACE", -1.0)
    taken = []

    def source() -> Iterator[Task]:
        for task in tasks:
            taken.append(task.number)
            yield task

    found = run(RayCluster(), source(), lambda: len(taken) == 2)
    assert statuses(found) == {0: "made", 1: "stopped"}
    assert not ray.living()


def test_an_actor_hears_while_it_works(tasks: list[Task], monkeypatch: pytest.MonkeyPatch) -> None:
    actor = ray_worker.Actor()
    actor.stop()  # of a task before

    def do(task: Task, stop: Stop, report: Callable[[int, float], None]) -> Outcome:
        assert not stop()
        report(task.number, 0.25)
        assert actor.done() == 0.25
        actor.stop()
        return Outcome(task.number, "stopped" if stop() else "made")

    monkeypatch.setattr(work, "do", do)
    found = actor.do(tasks[0])
    assert found.status == "stopped"


# Connecting.


def test_without_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UsageError, match=r'pip install "warpsplat\[ray\]"'):
        RayCluster()


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("address", "variable", "known", "asked"),
    [
        ("", "", {"auto"}, ["auto"]),
        ("", "", set(), ["auto", "local"]),
        ("", "10.0.0.1:6379", {"10.0.0.1:6379"}, ["10.0.0.1:6379"]),
        ("10.0.0.2:6379", "10.0.0.1:6379", {"10.0.0.2:6379"}, ["10.0.0.2:6379"]),
        ("local", "", {"auto"}, ["local"]),
    ],
)
def test_addresses(
    ray: FakeRay,
    tasks: list[Task],
    monkeypatch: pytest.MonkeyPatch,
    address: str,
    variable: str,
    known: set[str],
    asked: list[str],
) -> None:
    monkeypatch.setenv("RAY_ADDRESS", variable)
    ray.known = known
    run(RayCluster(address), tasks[:1])
    assert ray.addresses == asked


@pytest.mark.parametrize(
    ("address", "variable"), [("10.0.0.2:6379", ""), ("", "10.0.0.2:6379"), ("auto", "")]
)
def test_nobody_answers(
    ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch, address: str, variable: str
) -> None:
    monkeypatch.setenv("RAY_ADDRESS", variable)
    ray.known = set()
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
def test_signals_stay_ours(ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_says_what_it_waits_for(
    ray: FakeRay, tasks: list[Task], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "PATIENCE", -1.0)
    large = [replace(task, threads=8) for task in tasks]
    looks = 0

    def stop() -> bool:
        nonlocal looks
        looks += 1
        return looks > 5

    with caplog.at_level(logging.WARNING):
        assert statuses(run(RayCluster(), large, stop)) == {0: "stopped"}
    assert caplog.text.count("no room yet for --threads 8: its 2 nodes have 2 CPUs and 0 GPUs in all") == 1
