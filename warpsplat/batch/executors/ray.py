"""Do tasks on a Ray cluster; an extra, ``pip install "warpsplat[ray]"``.

Workers are actors: processes that the cluster starts where it has capacity. They are kept, so that each
starts Warp and loads kernels once.
"""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections.abc import Iterator
from types import ModuleType

from warpsplat._version import __version__
from warpsplat.batch.executors.ray_connection import connected, ray_cause
from warpsplat.batch.executors.ray_worker import RayWorker, TaskResources
from warpsplat.batch.executors.tasks import OnProgress, Outcome, Task
from warpsplat.batch.executors.workers import WorkerExecutor
from warpsplat.errors import ResourceError, UsageError, printable

log = logging.getLogger("warpsplat")

PAUSE = 1.0
"""Seconds between two questions about the progress of tasks and the capacity of the cluster."""

PATIENCE = 20.0
"""Seconds without any worker before a warning."""


class RayCluster(WorkerExecutor[RayWorker]):
    """Does tasks on a cluster."""

    tries = 3  # nodes of clusters go for many reasons: it need not be the image
    stillborn = "workers of the Ray cluster end as soon as they begin"

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
        super().__init__()
        self._ray: ModuleType = ray
        self._address, self._most, self._gpus = address, workers, gpus
        self._connection = contextlib.ExitStack()
        self._own = False
        """Whether the cluster was started for this."""
        self._asked = self._begun = 0.0
        """Times of the last questions to workers, and of the first search for one [s]; 0: not yet."""

    def __exit__(self, *error: object) -> None:
        """See ``Executor``. A cluster that was there before stays."""
        super().__exit__(*error)
        self._connection.close()

    def _give(self) -> None:
        """Hand out tasks; now and then, ask for progress, and look for more capacity."""
        super()._give()
        now = time.monotonic()
        self._begun = self._begun or now
        if now - self._asked > PAUSE:
            self._asked = now
            if self._own and not self._nodes():  # nobody else adds nodes to it
                cause = "has died, perhaps for lack of memory; the same command continues"
                raise ResourceError(f"the Ray cluster of this machine {cause}")
            for worker in self._busy():
                worker.ask_progress()
            self._hire()
        if now - self._begun > PATIENCE:
            self._begun = math.inf
            self._warn_of_waiting()

    def _has_place(self) -> bool:
        """See ``WorkerExecutor``: at most one more is taken, for a worker that is starting."""
        return not self._workers or any(worker.idle for worker in self._workers)

    def _worker_for(self, task: Task) -> RayWorker | None:
        if not self._ray.is_initialized():
            self._own = self._connection.enter_context(connected(self._ray, self._address))
        needed = self._resources(task)
        found = next((w for w in self._workers if w.idle and w.resources == needed), None)
        if found is None:
            self._hire(needed)
        return found

    def _resources(self, task: Task) -> TaskResources:
        """Return what a task takes: GPUs if it asks for one, or leaves it open and the cluster has any."""
        auto = task.device == "auto" and any(node.get("GPU") for node in self._nodes())
        return TaskResources(task.threads or 1, self._gpus if auto or task.device.startswith("cuda") else 0.0)

    def _nodes(self) -> list[dict[str, float]]:
        """Return the resources of each node that is alive."""
        return [node["Resources"] for node in self._ray.nodes() if node["Alive"]]

    def _hire(self, needed: TaskResources | None = None) -> None:
        """Start as many workers as the cluster has capacity for.

        ``needed``: of a task that waits, for which idle workers with others make room; None: as before, if no
        worker is idle.
        """
        if needed:
            self._remove([w for w in self._workers if w.resources != needed and not w.task])
        elif self._has_place():
            return
        needed = needed or self._workers[-1].resources
        capacity = self._most or max(1, sum(map(needed.capacity, self._nodes())))
        for _ in range(capacity - len(self._workers)):
            self._workers.append(RayWorker(self._ray, needed))

    def _warn_of_waiting(self) -> None:
        """Warn if no worker has answered yet."""
        if any(worker.responded for worker in self._workers):
            return
        nodes = self._nodes()
        cpus, gpus = (sum(node.get(kind, 0) for node in nodes) for kind in ("CPU", "GPU"))
        needed = self._workers[0].resources if self._workers else TaskResources(1, 0.0)
        log.warning(
            "the Ray cluster has no room yet for %s: its %d nodes have %g CPUs and %g GPUs in all; waiting",
            *(needed, len(nodes), cpus, gpus),
        )

    def _receive(self, on_progress: OnProgress) -> Iterator[Outcome]:
        answers = {worker.answer: worker for worker in self._workers if worker.answer is not None}
        progress = {worker.progress: worker for worker in self._workers if worker.progress is not None}
        calls = [*answers, *progress]
        poll = 0.2  # seconds between two calls of stop
        ready, _ = self._ray.wait(calls, num_returns=1, timeout=poll) if calls else ([], [])
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
        try:
            answer = self._ray.get(worker.answer)
        except self._ray.exceptions.RayError as error:
            cause = ray_cause(error)
            if not worker.responded and "No module named" in str(error):
                raise UsageError(
                    f"a node of the Ray cluster lacks a package: {cause}; warpsplat has to be on each"
                ) from error
            where = f"on {printable(worker.node)} " if worker.node else ""
            return self._lost(worker, f"{where}was lost: {cause}")
        worker.answer = worker.progress = None
        if worker.task:
            worker.task = None
            outcome: Outcome = answer
            if outcome.spent:
                self._remove([worker])
            return outcome
        version, worker.node = answer
        if version != __version__:
            raise UsageError(
                f"node {printable(worker.node)} of the Ray cluster has warpsplat {printable(version)}, "
                f"here it is {__version__}: results would differ; install one version on all"
            )
        worker.responded, self._stillborn = True, 0
        self.workers = max(self.workers, sum(other.responded for other in self._workers))
        return None
