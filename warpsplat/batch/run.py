"""Do the jobs of a batch, each once, even if other processes share it or earlier runs were interrupted."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from warpsplat.batch.executors.tasks import Executor, OnProgress, Outcome, Stop, Task
from warpsplat.batch.executors.work import failure
from warpsplat.batch.manifest import Entry, Event, Manifest, digest
from warpsplat.batch.plan import BatchJob
from warpsplat.batch.reports import Reports
from warpsplat.batch.results import ResultState, read_result, result_state
from warpsplat.errors import OutputError
from warpsplat.files.inputs import read_input
from warpsplat.files.output import make_folder, write_result
from warpsplat.files.remote import is_remote
from warpsplat.run.formats import is_picture
from warpsplat.run.result import STOPPED, job_key

log = logging.getLogger(__name__)

Status = Literal["made", "skipped", "failed", "stopped", "planned"]

PAUSE = 0.3
"""Seconds between two checks of the jobs that other processes have claimed."""


@dataclass(frozen=True)
class JobOutcome:
    """The outcome of a job."""

    job: BatchJob
    status: Status
    figures: Mapping[str, Any] = field(default_factory=dict)
    """See ``Result.as_dict``; for a skipped job those that are known."""
    error: str = ""
    """Why it failed, in one line."""
    before: bool = False
    """Whether it failed in an earlier run, and was not tried again."""

    def as_dict(self) -> dict[str, Any]:
        """Return the values for JSON."""
        values: dict[str, Any] = {"image": str(self.job.image), "output": str(self.job.output)}
        values |= {"status": self.status, **self.figures}
        return values | ({"error": self.error, "before": self.before} if self.error else {})


class Batch:
    """Runs jobs and keeps the manifest."""

    def __init__(
        self,
        jobs: list[BatchJob],
        manifest: Manifest,
        *,
        on_outcome: Callable[[JobOutcome], None],
        retry: bool = False,
        threads: int | None = None,
        reports: Reports | None = None,
    ) -> None:
        """Prepare to do jobs, with an open manifest; ``on_outcome`` is called as soon as an outcome is known.

        ``retry``: whether jobs that failed are tried again; ``threads``: for each task on a CPU.
        """
        self.jobs, self.manifest = jobs, manifest
        self._on_outcome, self._retry, self._threads = on_outcome, retry, threads
        self._reports = reports
        self._claimed: dict[int, Task] = {}

    def run(self, executor: Executor, stop: Stop, on_progress: OnProgress) -> None:
        """Do the jobs. Wait for those claimed by another process, and do them if it dies.

        Raises ``OutputError`` if the manifest cannot be written, ``ResourceError`` if there are no workers.
        """
        todo, waiting = list(range(len(self.jobs))), False
        while todo and not stop():
            later: list[int] = []
            for outcome in executor.run(self._tasks(todo, later, stop), stop, on_progress):
                on_progress(outcome.number, 1.0)
                self._settle(outcome)
            if later and not waiting:
                waiting = True
                log.info("waiting for %d images that another process is working on", len(later))
            if len(later) == len(todo):
                time.sleep(PAUSE)
            todo = later

    def dry_run(self, stop: Stop) -> None:
        """Report what a run would do, and do nothing."""
        for number, job in enumerate(self.jobs):
            if stop():
                return
            if self._task(number):
                self._on_outcome(JobOutcome(job, "planned"))

    def _tasks(self, todo: list[int], later: list[int], stop: Stop) -> Iterator[Task]:
        """Claim the jobs ``todo`` and yield their tasks; append those claimed by others to ``later``."""
        for number in todo:
            job = self.jobs[number]
            if stop() or (task := self._task(number)) is None:
                continue
            if stop():
                self._on_outcome(JobOutcome(job, "stopped"))
                return
            if not self.manifest.claim(job.output, task.key):
                later.append(number)
                continue
            self.manifest.refresh()  # the previous holder of the claim may have made it
            state = self._state(job, task.key)
            if state is None:
                self.manifest.release(job.output, task.key)
                continue
            if state.made:
                figures = state.entry.figures if state.entry else {}
                task = replace(task, result=read_result(job.output), figures=figures)
            self._claimed[number] = task
            yield task

    def _task(self, number: int) -> Task | None:
        """Return the task of a job, to make the result; None, after its outcome, if nothing is to be done."""
        job = self.jobs[number]
        try:
            image = read_input(job.image)
            mask = read_input(job.importance) if job.importance else None
            key = job_key(job.settings, image, mask)
        except Exception as error:
            message = failure(error, str(job.image), str(job.output))
            self._on_outcome(JobOutcome(job, "failed", error=message))
            return None
        if self._state(job, key) is None:
            return None
        return Task(
            number,
            key,
            image,
            str(job.image),
            str(job.output),
            job.settings,
            job.device,
            self._threads,
            mask,
            str(job.importance),
            report_back=self._reports.link_back(job.output) if self._reports else "",
        )

    def _state(self, job: BatchJob, key: str) -> ResultState | None:
        """Return the state of a result; None, after the job's outcome, if nothing is to be done."""
        state = result_state(job, key, self.manifest)
        made, entry = state
        reported = not (self._reports and self._reports.outdated(job.output))
        if made and (is_picture(job.output) or (entry and reported)):  # pictures are not measured
            self._on_outcome(JobOutcome(job, "skipped", entry.figures if entry else {}))
            return None
        if not made and entry and not self._retry:
            self._on_outcome(JobOutcome(job, "failed", error=entry.error, before=True))
            return None
        return state

    def _settle(self, outcome: Outcome) -> None:
        """Write a result, add the outcome to the manifest, and report it."""
        job, task = self.jobs[outcome.number], self._claimed.pop(outcome.number)
        status: Status = "skipped" if outcome.status == "measured" else outcome.status
        error = outcome.error
        try:
            if outcome.data is not None and outcome.status != "measured":
                if job.settings.minify or is_picture(job.output) or is_remote(job.output):
                    self._note(job, outcome, "writing")  # known by its digest, if this process ends now
                make_folder(job.output.parent)
                write_result(job.output, outcome.data)
            if outcome.status in ("made", "measured") and not task.figures:
                self._note(job, outcome, "made")
        except OutputError as failed:
            status, error = "failed", failure(failed, str(job.image), str(job.output))
        if status == "failed" and outcome.key:
            with contextlib.suppress(OutputError):  # the outcome tells it
                self._note(job, Outcome(outcome.number, "failed", outcome.key), "failed", error)
        if self._reports and status != "failed":
            self._reports.keep(job.output, outcome)
        self.manifest.release(job.output, task.key)
        self._on_outcome(JobOutcome(job, status, task.figures or outcome.figures, error))

    def _note(self, job: BatchJob, outcome: Outcome, event: Event, error: str = "") -> None:
        """Append an entry to the manifest; a result that was cut short is ours, but not the job's."""
        cut_short = outcome.data is not None and outcome.status in ("stopped", "failed")
        key = STOPPED if cut_short else outcome.key
        name, image = self.manifest.name(job.output), str(job.image)
        made = "" if outcome.data is None else digest(outcome.data)
        self.manifest.append(Entry(name, key, event, made, image, error, outcome.figures))
