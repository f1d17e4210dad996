"""Do tasks on a Ray cluster; an extra, ``pip install "warpsplat[ray]"``.

Workers are actors: processes that the cluster starts where it has free resources. They are kept, so that each
loads Warp and the kernels once; they report progress and can be stopped while they work. They write no files
but return their results, so that a worker that the cluster has given up, but that still runs, cannot replace
anything.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from types import ModuleType, TracebackType

from warpsplat._version import __version__
from warpsplat.batch.executors.ray_connection import cause_of, connected
from warpsplat.batch.executors.ray_worker import Need, Worker
from warpsplat.batch.executors.tasks import Advance, Outcome, Stop, Task
from warpsplat.batch.executors.work import failure
from warpsplat.errors import ImageError, ResourceError, UsageError, printable

log = logging.getLogger("warpsplat")

GRACE = 10.0
"""Seconds for tasks to end once they are stopped: a step, and returning the file."""

POLL_INTERVAL = 0.2
"""Seconds between two checks whether to stop."""

PAUSE = 1.0
"""Seconds between two queries of progress, and of room for more workers."""

PATIENCE = 20.0
"""Seconds without any worker until a notice says what the batch waits for."""

TRIES = 3
"""Attempts at a task whose worker is lost: nodes of clusters disappear for many reasons."""

MAX_FAILED_STARTS = 3
"""After this many workers in a row that are lost before they respond, no more are started."""


class RayCluster:
    """An ``Executor`` on a Ray cluster; all results are returned, none is written by a worker."""

    def __init__(self, address: str = "", *, workers: int | None = None, gpus: float = 1.0) -> None:
        """Connect to nothing until there is a task.

        Args:
            address: of the cluster, as Ray has it: ``host:port`` on a machine that belongs to it,
                ``ray://host:port`` from outside, ``local`` for one of this machine alone, which ends with the
                block; empty: the one that ``RAY_ADDRESS`` names or this machine belongs to, else ``local``.
            workers: most tasks at the same time; None: as many as the cluster has room for.
            gpus: what a task takes on CUDA: 0.25 for four that share a GPU.

        Raises:
            UsageError: Ray is not installed.
        """
        try:
            import ray
        except ImportError as error:
            raise UsageError(f'--executor ray: {error}; pip install "warpsplat[ray]" installs it') from error
        self._ray: ModuleType = ray
        self._address = address
        self._most = workers
        self._gpus = gpus
        self._workers: list[Worker] = []
        self._connected = False
        self._connection = contextlib.ExitStack()
        self._failed_starts = 0
        self._unseen: set[tuple[str, str]] = set()
        self._tries: Counter[int] = Counter()
        self._waiting: Iterator[Task] | None = None
        self._again: list[Task] = []
        self._met = 0
        self.lost = 0
        """Number of workers that were lost with a task."""

    @property
    def workers(self) -> int:
        """See ``Executor``: the most there were; before there are any, the number requested."""
        return self._met or self._most or 1

    def __enter__(self) -> RayCluster:
        """Return self; the first task connects to the cluster."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """See ``Executor``. A cluster that existed before stays."""
        self._dismiss(self._workers)
        self._connected = False
        self._connection.close()

    def run(self, tasks: Iterable[Task], stop: Stop, advance: Advance) -> Iterator[Outcome]:
        """See ``Executor``."""
        self._waiting = iter(tasks)
        self._again.clear()
        self._tries.clear()
        begun = looked = time.monotonic()
        while not stop():
            yield from self._give()
            if not self._waiting and not self._again and not self._busy():
                return
            now = time.monotonic()
            if now - looked > PAUSE:
                looked = now
                for worker in self._busy():
                    worker.ask()
                self._start_workers()
            if now - begun > PATIENCE:
                self._warn_waiting()
                begun = math.inf
            yield from self._listen(advance)
        yield from self._end_tasks(advance)

    def _busy(self) -> list[Worker]:
        return [worker for worker in self._workers if worker.task]

    def _next(self) -> Task | None:
        """Return the next task without a worker; None if there is none left."""
        if self._again:
            return self._again.pop()
        task = next(self._waiting, None) if self._waiting else None
        if task is None:
            self._waiting = None
        return task

    def _give(self) -> Iterator[Outcome]:
        """Give tasks to idle workers; at most one task waits, for a worker that is starting.

        Yields:
            failures of images that cannot be read.
        """
        while self._again or not self._workers or any(worker.idle for worker in self._workers):
            task = self._next()
            if task is None:
                return
            self._connect()
            need = self._need(task)
            worker = next((w for w in self._workers if w.idle and w.need == need), None)
            if worker is None:
                self._again.append(task)
                self._start_workers()
                return
            try:
                worker.give(task, self._unseen)
            except ImageError as error:
                yield Outcome(task.number, "failed", error=failure(error, task.name))

    def _need(self, task: Task) -> Need:
        """Return the needs of a task: a GPU if it asks for one, or does not say and the cluster has any."""
        auto = task.device == "auto" and any(found.get("GPU") for found in self._nodes())
        return Need(task.threads or 1, self._gpus if auto or task.device.startswith("cuda") else 0.0)

    def _nodes(self) -> list[dict[str, float]]:
        """Return the resources of each live node."""
        return [node["Resources"] for node in self._ray.nodes() if node["Alive"]]

    def _start_workers(self) -> None:
        """Start as many workers as there is room for; end idle workers with other needs."""
        if not self._again and (not self._workers or any(worker.idle for worker in self._workers)):
            return
        need = self._need(self._again[-1]) if self._again else self._workers[-1].need
        if self._again:
            self._dismiss([w for w in self._workers if w.need != need and not w.task])
        room = self._most or max(1, sum(need.fit(found) for found in self._nodes()))
        for _ in range(room - len(self._workers)):
            self._workers.append(Worker(self._ray, need))

    def _dismiss(self, workers: list[Worker]) -> None:
        for worker in list(workers):
            worker.end()
            self._workers.remove(worker)

    def _warn_waiting(self) -> None:
        """Warn if no worker has started yet."""
        if any(worker.node for worker in self._workers):
            return
        found = self._nodes()
        cpus, gpus = (sum(node.get(kind, 0) for node in found) for kind in ("CPU", "GPU"))
        need = self._workers[0].need if self._workers else Need(1, 0.0)
        log.warning(
            "the Ray cluster has no room yet for %s: its %d nodes have %g CPUs and %g GPUs in all; waiting",
            *(need, len(found), cpus, gpus),
        )

    def _listen(self, advance: Advance) -> Iterator[Outcome]:
        """Wait a moment for answers of workers, and handle them."""
        answers = {worker.answer: worker for worker in self._workers if worker.answer is not None}
        parts = {worker.part: worker for worker in self._workers if worker.part is not None}
        asked = [*answers, *parts]
        ready, _ = self._ray.wait(asked, num_returns=1, timeout=POLL_INTERVAL) if asked else ([], [])
        for reference in ready:
            if reference in parts:
                worker = parts[reference]
                worker.part = None
                with contextlib.suppress(self._ray.exceptions.RayError):  # its task will fail too
                    done = self._ray.get(reference)
                    if worker.task:
                        advance(worker.task.number, done)
            else:
                outcome = self._take_answer(answers[reference])
                if outcome:
                    yield outcome

    def _take_answer(self, worker: Worker) -> Outcome | None:
        """Handle the answer of a worker."""
        answer, task = worker.answer, worker.task
        worker.answer = worker.task = worker.part = None
        try:
            said = self._ray.get(answer)
        except self._ray.exceptions.RayError as error:
            self._dismiss([worker])
            if task:
                return self._retry_or_fail(worker, task, error)
            self._start_failed(error)
            return None
        self._failed_starts = 0
        if task is None:
            self._check_version(worker, said)
        elif isinstance(said, Outcome):
            return said
        else:
            self._unseen |= {(worker.node, os.path.dirname(path)) for path in said}
            self._again.append(task)
        return None

    def _check_version(self, worker: Worker, said: tuple[str, str]) -> None:
        version, worker.node = said
        self._met = max(self._met, sum(bool(other.node) for other in self._workers))
        if version != __version__:
            raise UsageError(
                f"node {printable(worker.node)} of the Ray cluster has warpsplat {printable(version)}, "
                f"here it is {__version__}: results would differ; install one version on all"
            )

    def _start_failed(self, error: BaseException) -> None:
        cause = cause_of(error)
        self._failed_starts += 1
        if "No module named" in str(error):
            raise UsageError(
                f"a node of the Ray cluster lacks a package: {cause}; warpsplat has to be on each"
            )
        if self._failed_starts >= MAX_FAILED_STARTS:
            raise ResourceError(f"workers of the Ray cluster end as soon as they begin: {cause}")

    def _retry_or_fail(self, worker: Worker, task: Task, error: BaseException) -> Outcome | None:
        """Queue the task of a lost worker again; after ``TRIES`` return a failure."""
        self.lost += 1
        self._tries[task.number] += 1
        name, node = printable(task.name), printable(worker.node)
        if self._tries[task.number] >= TRIES:
            text = f"{name}: its worker on {node} was lost, for time {TRIES}: {cause_of(error)}"
            return Outcome(task.number, "failed", error=text)
        log.warning("%s: its worker on %s was lost (%d so far); it is done again", name, node, self.lost)
        self._again.append(task)
        return None

    def _end_tasks(self, advance: Advance) -> Iterator[Outcome]:
        """End the current tasks, with the best so far if that comes in time."""
        for worker in self._busy():
            worker.stop()
        late = time.monotonic() + GRACE
        while self._busy() and time.monotonic() < late:
            yield from self._listen(advance)
        for task in [*self._again, *(worker.task for worker in self._busy() if worker.task)]:
            yield Outcome(task.number, "stopped")
        self._dismiss(self._busy())

    def _connect(self) -> None:
        """Connect to the cluster, or start one; see ``connected``."""
        if not self._connected:
            self._connection.enter_context(connected(self._ray, self._address))
            self._connected = True
