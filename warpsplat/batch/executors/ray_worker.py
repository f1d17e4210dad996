"""A worker of a Ray cluster as its parent knows it."""

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
    """What a task takes of a node while it is done."""

    cpus: int
    gpus: float

    def __str__(self) -> str:
        """For messages."""
        return f"--threads {self.cpus}" + (f" and --gpus {self.gpus:g}" if self.gpus else "")

    def fit(self, resources: Mapping[str, float]) -> int:
        """How many such tasks a node with ``resources`` has room for."""
        count = resources.get("CPU", 0.0) // self.cpus
        if self.gpus:
            # Ray never cuts a task's part out of two GPUs.
            whole = resources.get("GPU", 0.0)
            count = min(count, whole // self.gpus if self.gpus >= 1 else whole * (1 // self.gpus))
        return int(count)


class Worker:
    """An actor, the task that it has, and what it was asked."""

    def __init__(self, ray: ModuleType, need: Need) -> None:
        self._ray = ray
        self.need = need
        self.node = ""
        """Where it is; empty until it has said so."""
        self.task: Task | None = None
        options = {"num_cpus": need.cpus, "num_gpus": need.gpus, "max_concurrency": 2, "max_restarts": 0}
        self._actor = ray.remote(Actor).options(**options).remote()
        self.answer: Any = self._actor.hello.remote()
        """To hello, or to the task; None: it waits for a task."""
        self.part: Any = None
        """Answer to the question how far the task is."""

    @property
    def idle(self) -> bool:
        """Whether a task can be given to it."""
        return self.answer is None

    def give(self, task: Task, unseen: set[tuple[str, str]]) -> None:
        """Hand it a task, with paths of the files that its node sees, and the bytes of others.

        Args:
            task: what to do.
            unseen: nodes, and folders that they do not see.

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
            device="cuda:0"
            if self.need.gpus
            else "cpu",  # Ray shows a process the GPUs that it may use, no more
            threads=self.need.cpus,
            result=sent(task.output) if task.measure else None,
            bring=True,
        )
        self.answer = self._actor.do.remote(whole, tuple(sights))
        self.task = task

    def ask(self) -> None:
        """Ask how far it is."""
        self.part = self.part or self._actor.done.remote()

    def stop(self) -> None:
        """Have its task ended, with the best so far."""
        self._actor.stop.remote()

    def end(self) -> None:
        """End its process, at once."""
        with contextlib.suppress(Exception):  # of a cluster that is gone
            self._ray.kill(self._actor)
