"""What executors are given and give back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Literal, Protocol

from warpsplat.fit.settings import Settings

Source = str | bytes
"""Where an image is, or its bytes."""

Stop = Callable[[], bool]
"""Whether work should end; it is asked often, from the thread that runs the executor."""

Advance = Callable[[int, float], None]
"""Told the number of a task and which part of it is done."""


@dataclass(frozen=True)
class ReportWish:
    """What a report says besides what its task says."""

    back: str
    """Where its link to the index leads, a relative path."""
    figures: Mapping[str, Any] = field(default_factory=dict)
    """Of a result that was made earlier, what is known of it."""


@dataclass(frozen=True)
class Task:
    """An image to vectorize, or a result to measure.

    What a worker needs is in here: paths where it sees the files, bytes where it does not.
    """

    number: int
    """Names the task: its outcome has the same number."""
    image: Source
    name: str
    """How messages call the image."""
    output: str
    """The result. Its ending says whether it is gzipped, also where it is not written."""
    settings: Settings
    device: str = "auto"
    threads: int | None = None
    """Of a CPU; None: all cores."""
    mask: Source | None = None
    """How much the error of a pixel counts."""
    bring: bool = False
    """Whether the worker brings the result's bytes (``Outcome.data``) instead of writing ``output``."""
    measure: bool = False
    """Whether ``output`` is there already, and only its figures are wanted."""
    result: Source | None = None
    """What is to be measured, where the worker does not see ``output``."""
    report: ReportWish | None = None
    """The report that is to be brought along; None: none."""


@dataclass(frozen=True)
class Outcome:
    """What became of a task."""

    number: int
    """Of the task."""
    status: Literal["made", "measured", "stopped", "failed"]
    """``stopped``: ended by ``stop``, with a file of the best so far, or none, where ``digest`` is empty."""
    key: str = ""
    """Of the result, see ``vectorize.job_key``; empty where the image could not be read."""
    digest: str = ""
    """SHA-256 of the result's bytes, hexadecimal."""
    data: bytes | None = field(default=None, repr=False)
    """The result's bytes, where they were to be brought."""
    figures: dict[str, Any] = field(default_factory=dict)
    """See ``vectorize.Result.as_dict``; of a task that measured, what was measured of those."""
    error: str = ""
    """One line that names the image, of a task that failed."""
    report: str = field(default="", repr=False)
    """The page, where one was asked for and could be made."""
    report_error: str = ""
    """One line on why it could not."""


class Executor(Protocol):
    """Does tasks. A context manager: what it holds (processes, connections) is gone after its block, whatever
    ended that, and so are the tasks that were in work.
    """

    @property
    def workers(self) -> int:
        """How many tasks it does at the same time; for messages."""

    def __enter__(self) -> Executor:
        """Begin. Nothing is started before there is a task."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End all workers at once; return when none is left."""

    def run(self, tasks: Iterable[Task], stop: Stop, advance: Advance) -> Iterator[Outcome]:
        """Do ``tasks``, and yield an outcome for each that was taken, in any order, as it ends.

        May be called again, one run after the other; workers are kept for that.

        * ``tasks`` is taken from only when a worker is free, or soon will be: taking a task claims it, and
          reads its image, so that no more are claimed than are in work (back-pressure).
        * Whatever an image throws is its own outcome, ``failed``. A worker that is lost costs its task
          another try, and after a few a ``failed`` outcome, never the batch.
        * Once ``stop`` says so, no further task is taken; those in work end soon, as ``stopped`` or as they
          would have.
        * ``advance`` is told how far tasks are, now and then, where that is known.
        """
