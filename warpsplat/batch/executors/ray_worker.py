"""Workers of a Ray cluster: the actor that does tasks, and the worker as its parent sees it.

Ray itself is not imported here.
"""

from __future__ import annotations

import contextlib
import os
import platform
import threading
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from warpsplat._version import __version__
from warpsplat.batch.executors.tasks import Outcome, Source, Task
from warpsplat.files.inputs import read_input


class FileStamp(NamedTuple):
    """A file as one machine sees it; another one that sees the same stamp sees the same file."""

    path: str
    size: int
    modified: int
    """Whole seconds: file systems differ in the fraction that they keep."""

    @staticmethod
    def of(path: str) -> FileStamp | None:
        """Return the stamp of a file on this machine, or None if it is not there."""
        try:
            found = os.stat(path)
        except OSError:
            return None
        return FileStamp(path, found.st_size, int(found.st_mtime))


class Actor:
    """A process of the cluster: does a task in one thread, and answers in another one meanwhile."""

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._done = 0.0

    def hello(self) -> tuple[str, str]:
        """Return the version of the package, and the node; plain types, which other versions understand."""
        return __version__, platform.node()

    def do(self, task: Task, stamps: tuple[FileStamp, ...]) -> Outcome | tuple[str, ...]:
        """Do a task.

        Args:
            task: its paths are those of ``stamps``.
            stamps: files as the parent sees them.

        Returns:
            The outcome; or, if nothing was done, the files that are not seen here.
        """
        unseen = tuple(stamp.path for stamp in stamps if FileStamp.of(stamp.path) != stamp)
        if unseen:
            return unseen
        from warpsplat.batch.executors.work import do  # heavy, and hello is to be quick

        self._stop.clear()
        self._done = 0.0

        def on_progress(number: int, fraction: float) -> None:
            self._done = fraction

        return do(task, self._stop.is_set, on_progress)

    def stop(self) -> None:
        """End the task in progress with the best so far."""
        self._stop.set()

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
        """Name of its node; empty until it has answered."""
        self.task: Task | None = None
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

    def give(self, task: Task, unseen: set[tuple[str, str]]) -> None:
        """Hand it a task with paths of the files that its node sees, and the bytes of others.

        Args:
            task: the task.
            unseen: nodes, and folders that they do not see.

        Raises:
            ImageError: a file that it does not see cannot be read here either.
        """
        stamps: list[FileStamp] = []

        def sent(source: Source) -> Source:
            if isinstance(source, bytes):
                return source
            stamp = FileStamp.of(os.path.abspath(source))
            if not stamp or (self.node, os.path.dirname(stamp.path)) in unseen:
                return read_input(Path(source))
            stamps.append(stamp)
            return stamp.path

        # Ray shows a process only the GPUs that it may use.
        self.answer = self._actor.do.remote(
            replace(
                task,
                image=sent(task.image),
                mask=None if task.mask is None else sent(task.mask),
                device="cuda:0" if self.resources.gpus else "cpu",
                threads=self.resources.cpus,
                result=sent(task.output) if task.measure else None,
                bring=True,
            ),
            tuple(stamps),
        )
        self.task = task

    def ask_progress(self) -> None:
        """Ask for its progress, unless it has not answered that yet."""
        self.progress = self.progress or self._actor.done.remote()

    def stop(self) -> None:
        """Have its task end with the best so far."""
        self._actor.stop.remote()

    def end(self) -> None:
        """End its process at once."""
        with contextlib.suppress(Exception):  # the cluster may be gone
            self._ray.kill(self._actor)
