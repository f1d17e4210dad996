"""Tasks and outcomes of executors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Literal, Protocol

from warpsplat.fit.settings import Settings

Source = str | bytes
"""Path of a file, or its bytes."""

Stop = Callable[[], bool]
"""Returns whether to stop; called often, from the thread that runs the executor."""

Advance = Callable[[int, float], None]
"""Called with the number of a task and the fraction of it that is done."""


@dataclass(frozen=True)
class ReportRequest:
    """Contents of a report that are not in its task."""

    back: str
    """Relative path of its link to the index."""
    figures: Mapping[str, Any] = field(default_factory=dict)
    """Known figures of an earlier result."""


@dataclass(frozen=True)
class Task:
    """An image to vectorize, or a result to measure.

    It has all a worker needs: paths of files that it sees, bytes of others.
    """

    number: int
    """Identifies the task; its outcome has the same number."""
    image: Source
    name: str
    """Name of the image in messages."""
    output: str
    """Path of the result, whose ending gives its format even if the worker does not write it."""
    settings: Settings
    device: str = "auto"
    threads: int | None = None
    """CPU threads; None: all cores."""
    mask: Source | None = None
    """Importance of pixels."""
    bring: bool = False
    """Whether the worker returns the result's bytes (``Outcome.data``) instead of writing ``output``."""
    measure: bool = False
    """Whether ``output`` exists, and only its figures are wanted."""
    result: Source | None = None
    """The result to measure, if the worker does not see ``output``."""
    report: ReportRequest | None = None
    """The report to make as well, if any."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a task."""

    number: int
    """Number of the task."""
    status: Literal["made", "measured", "stopped", "failed"]
    """``stopped``: ended by ``stop``, with a file of the best so far, or none, where ``digest`` is empty."""
    key: str = ""
    """Key of the result, see ``keys.job_key``; empty if the image could not be read."""
    digest: str = ""
    """SHA-256 of the result's bytes, hexadecimal."""
    data: bytes | None = field(default=None, repr=False)
    """The result's bytes, if they were requested."""
    figures: dict[str, Any] = field(default_factory=dict)
    """See ``vectorize.Result.as_dict``; of a task that measured, what was measured of those."""
    error: str = ""
    """One line that names the image, of a task that failed."""
    report: str = field(default="", repr=False)
    """The page, if requested and made."""
    report_error: str = ""
    """Why it could not be made."""


class Executor(Protocol):
    """Does tasks. A context manager: its processes, connections and current tasks end with the block."""

    @property
    def workers(self) -> int:
        """Number of tasks at the same time, for messages."""

    def __enter__(self) -> Executor:
        """Return self; nothing starts before there is a task."""

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
        * An error of an image is its outcome, ``failed``. The task of a lost worker is tried again, and fails
          after a few attempts; the batch goes on.
        * Once ``stop`` returns true, no further task is taken; current ones end soon, as ``stopped`` or done.
        * ``advance`` is called now and then with the progress of tasks, if it is known.
        """
