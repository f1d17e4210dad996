"""Do tasks on a Ray cluster; an extra, ``pip install "warpsplat[ray]"``.

Workers are actors: processes that the cluster starts where it has capacity. They are kept, so that each
starts Warp and loads kernels once. They write no files but return all results, so that a worker which the
cluster has given up, but which is still running somewhere, can replace nothing.
"""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from types import ModuleType

from warpsplat._version import __version__
from warpsplat.batch.executors.ray_connection import connected, ray_cause
from warpsplat.batch.executors.ray_worker import RayWorker, TaskResources
from warpsplat.batch.executors.tasks import Executor, OnProgress, Outcome, Stop, Task
from warpsplat.errors import ResourceError, UsageError, printable

log = logging.getLogger("warpsplat")

GRACE = 10.0
"""Seconds that tasks have to end after they are asked to stop: for a step, and returning the file."""

POLL = 0.2
"""Seconds between two calls of ``stop``."""

PAUSE = 1.0
"""Seconds between two questions about the progress of tasks and the capacity of the cluster."""

PATIENCE = 20.0
"""Seconds without any worker before a warning."""

TRIES = 3
"""Tries of a task whose worker is lost. Nodes of clusters go for many reasons: it need not be the image."""

MOST_STILLBORN = 3
"""After so many workers in a row that are lost before they answer, no more are started."""


class RayCluster(Executor):
    """Does tasks on a cluster; every result is returned, also of tasks without ``bring``."""

    def __init__(self, address: str = "", *, workers: int | None = None, gpus: float = 1.0) -> None:
        """Nothing is connected to before there is a task.

        Args:
            address: address of the cluster, as Ray has it: ``host:port`` on a machine that belongs to it,
                ``ray://host:port`` from outside, ``local`` for a new one of this machine alone; empty: the
                one that ``RAY_ADDRESS`` names or this machine belongs to, else ``local``.
            workers: most tasks at the same time; None: as many as the cluster has capacity for.
            gpus: GPUs of a task on CUDA: 0.25 for four that share one.

        Raises:
            UsageError: Ray is not installed.
        """
        try:
            import ray
        except ImportError as error:
            raise UsageError(f'--executor ray: {error}; pip install "warpsplat[ray]" installs it') from error
        self._ray: ModuleType = ray
        self._address, self._most, self._gpus = address, workers, gpus
        self._connection: contextlib.ExitStack | None = None
        self._workers: list[RayWorker] = []
        self.workers = workers or 1
        self._answered = 0
        """Most workers that there were."""
        self._stillborn = 0
        self._tries: Counter[int] = Counter()
        self._waiting: Iterator[Task] | None = None
        """Tasks that were not taken yet; None: all were."""
        self._again: list[Task] = []
        self.lost = 0
        """Workers that were lost with a task."""

    def close(self) -> None:
        """See ``Executor``. A cluster that was there before stays."""
        self._remove(self._workers)
        if self._connection:
            self._connection.close()
            self._connection = None

    def run(self, tasks: Iterable[Task], stop: Stop, on_progress: OnProgress) -> Iterator[Outcome]:
        """See ``Executor``."""
        self._waiting, self._again = iter(tasks), []
        self._tries.clear()
        begun = asked = time.monotonic()
        while not stop():
            self._give()
            if not self._waiting and not self._again and not self._busy():
                return
            now = time.monotonic()
            if now - asked > PAUSE:
                asked = now
                for worker in self._busy():
                    worker.ask_progress()
                self._hire()
            if now - begun > PATIENCE:
                self._warn_of_waiting()
                begun = math.inf
            yield from self._receive(on_progress)
        yield from self._stop_tasks(on_progress)

    def _busy(self) -> list[RayWorker]:
        return [worker for worker in self._workers if worker.task]

    def _give(self) -> None:
        """Hand tasks to idle workers; at most one more is taken, for a worker that is starting."""
        while self._again or not self._workers or any(worker.idle for worker in self._workers):
            task = self._again.pop() if self._again else next(self._waiting or iter(()), None)
            if task is None:
                self._waiting = None
                return
            if self._connection is None:
                self._connection = contextlib.ExitStack()
                self._connection.enter_context(connected(self._ray, self._address))
            needed = self._resources(task)
            worker = next((w for w in self._workers if w.idle and w.resources == needed), None)
            if worker is None:
                self._again.append(task)
                self._hire()
                return
            worker.give(task)

    def _resources(self, task: Task) -> TaskResources:
        """Return what a task takes: GPUs if it asks for one, or leaves it open and the cluster has any."""
        auto = task.device == "auto" and any(node.get("GPU") for node in self._nodes())
        return TaskResources(task.threads or 1, self._gpus if auto or task.device.startswith("cuda") else 0.0)

    def _nodes(self) -> list[dict[str, float]]:
        """Return the resources of each node that is alive."""
        return [node["Resources"] for node in self._ray.nodes() if node["Alive"]]

    def _hire(self) -> None:
        """Start as many workers as the cluster has capacity for; idle ones for other resources make room."""
        if not self._again and (not self._workers or any(worker.idle for worker in self._workers)):
            return
        needed = self._resources(self._again[-1]) if self._again else self._workers[-1].resources
        if self._again:
            self._remove([w for w in self._workers if w.resources != needed and not w.task])
        capacity = self._most or max(1, sum(map(needed.capacity, self._nodes())))
        for _ in range(capacity - len(self._workers)):
            self._workers.append(RayWorker(self._ray, needed))

    def _remove(self, workers: list[RayWorker]) -> None:
        for worker in list(workers):
            worker.end()
            self._workers.remove(worker)

    def _warn_of_waiting(self) -> None:
        """Warn if no worker has answered yet."""
        if any(worker.node for worker in self._workers):
            return
        nodes = self._nodes()
        cpus, gpus = (sum(node.get(kind, 0) for node in nodes) for kind in ("CPU", "GPU"))
        needed = self._workers[0].resources if self._workers else TaskResources(1, 0.0)
        log.warning(
            "the Ray cluster has no room yet for %s: its %d nodes have %g CPUs and %g GPUs in all; waiting",
            *(needed, len(nodes), cpus, gpus),
        )

    def _receive(self, on_progress: OnProgress) -> Iterator[Outcome]:
        """Handle what workers answer, after a short wait for it."""
        answers = {worker.answer: worker for worker in self._workers if worker.answer is not None}
        progress = {worker.progress: worker for worker in self._workers if worker.progress is not None}
        calls = [*answers, *progress]
        ready, _ = self._ray.wait(calls, num_returns=1, timeout=POLL) if calls else ([], [])
        for call in ready:
            if call in progress:
                worker = progress[call]
                worker.progress = None
                with contextlib.suppress(self._ray.exceptions.RayError):  # its task fails as well
                    fraction = self._ray.get(call)
                    if worker.task:
                        on_progress(worker.task.number, fraction)
            elif outcome := self._handle_answer(answers[call]):
                yield outcome

    def _handle_answer(self, worker: RayWorker) -> Outcome | None:
        """Handle the answer to ``hello`` or to a task; return the task's outcome if it has ended."""
        call, task = worker.answer, worker.task
        worker.answer = worker.task = worker.progress = None
        try:
            answer = self._ray.get(call)
        except self._ray.exceptions.RayError as error:
            self._remove([worker])
            if task:
                return self._retry(worker, task, error)
            self._count_stillborn(error)
            return None
        self._stillborn = 0
        if task:
            outcome: Outcome = answer
            return outcome
        self._greet(worker, *answer)
        return None

    def _greet(self, worker: RayWorker, version: str, node: str) -> None:
        worker.node = node
        self._answered = max(self._answered, sum(bool(other.node) for other in self._workers))
        self.workers = self._answered
        if version != __version__:
            raise UsageError(
                f"node {printable(node)} of the Ray cluster has warpsplat {printable(version)}, "
                f"here it is {__version__}: results would differ; install one version on all"
            )

    def _count_stillborn(self, error: BaseException) -> None:
        cause = ray_cause(error)
        self._stillborn += 1
        if "No module named" in str(error):
            raise UsageError(
                f"a node of the Ray cluster lacks a package: {cause}; warpsplat has to be on each"
            )
        if self._stillborn >= MOST_STILLBORN:
            raise ResourceError(f"workers of the Ray cluster end as soon as they begin: {cause}")

    def _retry(self, worker: RayWorker, task: Task, error: BaseException) -> Outcome | None:
        """Keep a task whose worker is lost for another try; return its failure if there were enough."""
        self.lost += 1
        self._tries[task.number] += 1
        name, node = printable(task.name), printable(worker.node)
        if self._tries[task.number] >= TRIES:
            text = f"{name}: its worker on {node} was lost, for time {TRIES}: {ray_cause(error)}"
            return Outcome(task.number, "failed", error=text)
        log.warning("%s: its worker on %s was lost (%d so far); it is done again", name, node, self.lost)
        self._again.append(task)
        return None

    def _stop_tasks(self, on_progress: OnProgress) -> Iterator[Outcome]:
        """End the tasks in progress: with the best so far if that comes soon."""
        for worker in self._busy():
            worker.stop()
        deadline = time.monotonic() + GRACE
        while self._busy() and time.monotonic() < deadline:
            yield from self._receive(on_progress)
        for task in [*self._again, *(worker.task for worker in self._busy() if worker.task)]:
            yield Outcome(task.number, "stopped")
        self._remove(self._busy())
