"""The interface of executors: tasks, outcomes, and the base class."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, Literal

from warpsplat.fit.settings import Settings

Stop = Callable[[], bool]
"""Returns whether work should end; called often, from the thread that runs the executor."""

OnProgress = Callable[[int, float], None]
"""Called with the number of a task and the fraction of it that is done."""


@dataclass(frozen=True)
class Task:
    """An image to vectorize, or a result to measure."""

    number: int
    """Identifies the task: its outcome has the same number."""
    key: str
    """Key of the result, see ``run.result.job_key``."""
    image: bytes = field(repr=False)
    name: str
    """Name of the image in messages."""
    output: str
    """Path of the result, which the worker does not write; its ending decides the format."""
    settings: Settings
    device: str = "auto"
    threads: int | None = None
    """Threads on a CPU; None: the usual number."""
    mask: bytes | None = field(default=None, repr=False)
    """Importance mask."""
    mask_name: str = ""
    """Name of the mask in messages."""
    result: bytes | None = field(default=None, repr=False)
    """The result if it exists already, and only its figures are wanted."""
    report_back: str = ""
    """Relative path that the report to return links back to; empty: no report is requested."""
    figures: Mapping[str, Any] = field(default_factory=dict)
    """Figures of the ``result``, as far as they are known."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of a task."""

    number: int
    status: Literal["made", "measured", "stopped", "failed"]
    """``stopped``: by ``stop``, with the best so far as its ``data``, or with none."""
    key: str = ""
    """Key of the task; empty if its worker was lost or ended before the task."""
    data: bytes | None = field(default=None, repr=False)
    """The result's bytes."""
    figures: dict[str, Any] = field(default_factory=dict)
    """See ``Result.as_dict``; for a task with a ``result``, those that can be measured."""
    error: str = ""
    """Why the task failed, in one line that names the image; with ``data`` if that could be saved."""
    spent: bool = False
    """Whether the process cannot use its device any more."""
    report: str = field(default="", repr=False)
    """The page, if it was requested and could be made."""
    report_error: str = ""
    """Why the page could not be made, in one line."""


class Executor(AbstractContextManager["Executor"]):
    """Base of executors: does tasks, but writes no files; a lost worker that still runs can replace none.

    At the end of its ``with`` block, all its workers have ended.
    """

    workers: int = 1
    """How many tasks it does at the same time; for messages."""

    def __exit__(self, *error: object) -> None:
        """End all workers at once; return when none is left. By default there are none."""

    def run(self, tasks: Iterable[Task], stop: Stop, on_progress: OnProgress) -> Iterator[Outcome]:
        """Do ``tasks``, and yield an outcome for each that was taken, in any order, as it ends.

        May be called several times, one run after the other; workers are kept.

        * A task is taken only when a worker is free, or soon will be: that claims it and reads its image.
        * Errors of an image are in its outcome, ``failed``. A worker that is lost costs its task a try; after
          a few tries its outcome is ``failed``, and the batch goes on.
        * Once ``stop`` returns true, no further task is taken; those in progress end soon.
        * ``on_progress`` is called now and then, if the progress of tasks is known.
        """
        raise NotImplementedError
