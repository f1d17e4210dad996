"""A worker of a Ray cluster, as seen by its parent."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import replace
from types import ModuleType
from typing import Any, NamedTuple

from warpsplat.batch.executors.ray_actor import Actor, Sight
from warpsplat.batch.executors.tasks import Source, Task
from warpsplat.batch.executors.work import read


class Need(NamedTuple):
    """Resources of a node that a task uses."""

    cpus: int
    gpus: float

    def __str__(self) -> str:
        """Return the flags that give it, for messages."""
        return f"--threads {self.cpus}" + (f" and --gpus {self.gpus:g}" if self.gpus else "")

    def fit(self, resources: Mapping[str, float]) -> int:
        """Return how many such tasks fit on a node with ``resources``."""
        count = resources.get("CPU", 0.0) // self.cpus
        if self.gpus:
            # Ray never cuts a task's part out of two GPUs.
            whole = resources.get("GPU", 0.0)
            count = min(count, whole // self.gpus if self.gpus >= 1 else whole * (1 // self.gpus))
        return int(count)


class Worker:
    """An actor, its current task, and pending queries."""

    def __init__(self, ray: ModuleType, need: Need) -> None:
        self._ray = ray
        self.need = need
        self.node = ""
        """Its node; empty until it answered."""
        self.task: Task | None = None
        options = {"num_cpus": need.cpus, "num_gpus": need.gpus, "max_concurrency": 2, "max_restarts": 0}
        self._actor = ray.remote(Actor).options(**options).remote()
        self.answer: Any = self._actor.hello.remote()
        """Answer to hello or to the task; None: it is idle."""
        self.part: Any = None
        """Answer to the query of progress."""

    @property
    def idle(self) -> bool:
        """Return whether it can take a task."""
        return self.answer is None

    def give(self, task: Task, unseen: set[tuple[str, str]]) -> None:
        """Send it a task, with the paths of files that its node sees, and the bytes of others.

        Args:
            task: what to do.
            unseen: pairs of a node and a folder that it does not see.

        Raises:
            ImageError: a file that it does not see cannot be read here either.
        """
        sights: list[Sight] = []

        def sent(source: Source) -> Source:
            if isinstance(source, bytes):
                return source
            sight = Sight.of(os.path.abspath(source))
            if not sight or (self.node, os.path.dirname(sight.path)) in unseen:
                return read(source)
            sights.append(sight)
            return sight.path

        whole = replace(
            task,
            image=sent(task.image),
            mask=None if task.mask is None else sent(task.mask),
            device="cuda:0" if self.need.gpus else "cpu",  # Ray shows a process only its own GPUs
            threads=self.need.cpus,
            result=sent(task.output) if task.measure else None,
            bring=True,
        )
        self.answer = self._actor.do.remote(whole, tuple(sights))
        self.task = task

    def ask(self) -> None:
        """Query its progress."""
        self.part = self.part or self._actor.done.remote()

    def stop(self) -> None:
        """End its task, with the best so far."""
        self._actor.stop.remote()

    def end(self) -> None:
        """Kill its process."""
        with contextlib.suppress(Exception):  # of a cluster that is gone
            self._ray.kill(self._actor)
