"""Doing planned jobs: whatever one of them throws is its own failure, the others go on."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

from warpsplat.errors import OutputError, explain, printable
from warpsplat.files.inputs import read_input
from warpsplat.jobs.plan import Job
from warpsplat.jobs.vectorize import Result

Status = Literal["made", "skipped", "failed", "stopped"]


@dataclass(frozen=True)
class Outcome:
    """What became of a job."""

    job: Job
    status: Status
    result: Result | None = None
    """Of a job that was done now."""
    error: str = ""
    """One line, of a job that failed."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        values: dict[str, Any] = {"image": str(self.job.image), "output": str(self.job.output)}
        values["status"] = self.status
        if self.error:
            values["error"] = self.error
        return values | (self.result.as_dict() if self.result else {})


def execute(job: Job, run: Callable[[Job, bytes], Result]) -> Outcome:
    """Do ``job`` if its result is not there yet.

    Args:
        job: what to do.
        run: does it, given the image's bytes, and writes the result.

    Raises:
        KeyboardInterrupt: at once, with nothing of this image to save.
    """
    try:
        data = read_input(job.image)
        if job.done(data):
            return Outcome(job, "skipped")
        try:
            job.output.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{job.output.parent}: cannot be made: {error.strerror}") from error
        result = run(job, data)
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of Rust code derives from no Exception
        message, _ = explain(error)
        image = printable(str(job.image))
        named = image in message or printable(str(job.output)) in message
        return Outcome(job, "failed", error=message if named else f"{image}: {message}")
    return Outcome(job, "stopped" if result.stopped else "made", result)


def counts(outcomes: Iterable[Outcome]) -> dict[str, int]:
    """How many were made, skipped, and failed."""
    found = [outcome.status for outcome in outcomes]
    return {status: found.count(status) for status in ("made", "skipped", "failed")}
