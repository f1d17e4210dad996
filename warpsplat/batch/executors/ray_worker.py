"""Workers of a Ray cluster: the actor that does tasks, and the worker as its parent sees it.

Ray itself is not imported here.
"""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Mapping
from dataclasses import replace
from types import ModuleType
from typing import Any, NamedTuple

from warpsplat._version import __version__
from warpsplat.batch.executors.tasks import Outcome, Task


class Actor:
    """A process of the cluster: does a task in one thread, and answers in another one meanwhile."""

    def __init__(self) -> None:
        self._stopped = -1  # number of the task that is to end
        self._done = 0.0

    def hello(self) -> tuple[str, str]:
        """Return the version of the package, and the node; plain types, which other versions understand."""
        return __version__, platform.node()

    def do(self, task: Task) -> Outcome:
        """Do a task."""
        from warpsplat.batch.executors.work import do  # heavy, and hello is to be quick

        self._done = 0.0

        def on_progress(number: int, fraction: float) -> None:
            self._done = fraction

        return do(task, lambda: self._stopped == task.number, on_progress)

    def stop(self, number: int) -> None:
        """End a task with the best so far, or as soon as it begins."""
        self._stopped = number

    def done(self) -> float:
        """Return the fraction of the task in progress that is done."""
        return self._done


class TaskResources(NamedTuple):
    """CPUs and GPUs of a node that a task takes."""

    cpus: int
    gpus: float

    def __str__(self) -> str:
        """Return the options that request them."""
        return f"--threads {self.cpus}" + (f" and --gpus {self.gpus:g}" if self.gpus else "")

    def capacity(self, node: Mapping[str, float]) -> int:
        """Return how many such tasks fit into a node with these resources."""
        count = node.get("CPU", 0.0) // self.cpus
        if self.gpus:
            # Ray never takes a task's share from two GPUs.
            whole = node.get("GPU", 0.0)
            count = min(count, whole // self.gpus if self.gpus >= 1 else whole * (1 // self.gpus))
        return int(count)


class RayWorker:
    """An actor, the task that it has, and the calls to it that are not answered yet."""

    def __init__(self, ray: ModuleType, resources: TaskResources) -> None:
        self._ray = ray
        self.resources = resources
        self.node = ""
        """Name of its node."""
        self.task: Task | None = None
        self.responded = False
        cpus, gpus = resources
        options = {"num_cpus": cpus, "num_gpus": gpus, "max_concurrency": 2, "max_restarts": 0}
        self._actor = ray.remote(Actor).options(**options).remote()
        self.answer: Any = self._actor.hello.remote()
        """The answer to ``hello`` or the task; None: it waits for a task."""
        self.progress: Any = None
        """The answer to the last question about its progress."""

    @property
    def idle(self) -> bool:
        """Whether it can be given a task."""
        return self.answer is None

    def give(self, task: Task) -> None:
        """See ``TaskWorker``."""
        self.task = task
        # Ray shows a process only the GPUs that it may use.
        device = "cuda:0" if self.resources.gpus else "cpu"
        task = replace(task, device=device, threads=self.resources.cpus)
        self.answer = self._actor.do.remote(task)

    def ask_progress(self) -> None:
        """Ask for its progress, unless it has not answered that yet."""
        self.progress = self.progress or self._actor.done.remote()

    def stop(self) -> None:
        """See ``TaskWorker``."""
        if self.task:
            self._actor.stop.remote(self.task.number)

    def end(self) -> None:
        """See ``TaskWorker``."""
        with contextlib.suppress(Exception):  # the cluster may be gone
            self._ray.kill(self._actor)
