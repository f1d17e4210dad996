"""Do the jobs of a batch, each once, even if other processes share it or earlier runs were interrupted."""

from __future__ import annotations

import contextlib
import logging
import os
import stat
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

from warpsplat.batch.executors.tasks import Advance, Executor, Outcome, ReportRequest, Source, Stop, Task
from warpsplat.batch.executors.work import digest, failure
from warpsplat.batch.manifest import Entry, Manifest
from warpsplat.batch.plan import Job
from warpsplat.batch.reports import Reports
from warpsplat.errors import ImageError, OutputError
from warpsplat.files.inputs import MAX_INPUT, read_input
from warpsplat.files.marks import GZIP, HEAD, picture_key
from warpsplat.files.output import make_folder, may_replace, write_result
from warpsplat.files.remote import exists, is_remote, listed, read_remote
from warpsplat.run.formats import is_picture
from warpsplat.run.result import STOPPED, job_key
from warpsplat.svg.inspect import svg_text
from warpsplat.svg.write import read_metadata

log = logging.getLogger(__name__)

Status = Literal["made", "skipped", "failed", "stopped", "planned"]

PAUSE = 0.3
"""Seconds between two checks of what other processes are working on."""

TAIL = b"</svg>\n"
"""End of every complete SVG."""


@dataclass(frozen=True)
class JobReport:
    """What became of a job."""

    job: Job
    status: Status
    figures: Mapping[str, Any] = field(default_factory=dict)
    """See ``vectorize.Result.as_dict``; of a skipped one those that are known."""
    error: str = ""
    """One line, of a job that failed."""
    before: bool = False
    """Whether it failed in an earlier run, and was not tried again."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        values: dict[str, Any] = {"image": str(self.job.image), "output": str(self.job.output)}
        values |= {"status": self.status, **self.figures}
        return values | ({"error": self.error, "before": self.before} if self.error else {})


class JobInputs(NamedTuple):
    """A job's key and inputs."""

    key: str
    image: bytes
    mask: bytes | None


class ResultState(NamedTuple):
    """Whether a result exists."""

    made: bool
    entry: Entry | None
    """Its entry in the manifest: how an existing result was made, or that the job failed."""


def read_inputs(job: Job) -> JobInputs:
    """Read a job's inputs.

    Raises:
        ImageError: they cannot be read.
    """
    image = read_input(job.image)
    mask = read_input(job.importance) if job.importance else None
    return JobInputs(job_key(job.settings, image, mask), image, mask)


def result_state(job: Job, key: str, manifest: Manifest) -> ResultState:
    """Find the complete result of ``key``, by the key in the file or the file's digest in the manifest."""
    entries = [entry for entry in manifest.entries(job.output) if entry.key == key]
    if is_remote(job.output):
        # The manifest is trusted: fetching each result would take longer than many take to make.
        latest = entries[-1] if entries else None
        if latest and latest.event == "made" and exists(job.output):
            return ResultState(True, latest)
    data = read_result(job.output)
    if data is not None:
        sum_ = digest(data)
        # A result that was about to be written and exists has been made.
        known = [e for e in entries if e.digest == sum_ and (e.event == "made" or e.figures)]
        if known:
            return ResultState(True, known[-1])
        if marked(data) == key or any(entry.digest == sum_ for entry in entries):
            return ResultState(True, None)
    failed = entries[-1] if entries and entries[-1].event == "failed" else None
    return ResultState(False, failed)


def read_result(path: Path) -> bytes | None:
    """Return the bytes of a result, or None if there is none or it is no regular file."""
    if is_remote(path):
        return read_remote(path, MAX_INPUT) if listed(path) else None
    with contextlib.suppress(OSError):
        found = os.stat(path)
        if (
            stat.S_ISREG(found.st_mode) and found.st_size <= MAX_INPUT
        ):  # a pipe would wait for whoever fills it
            return path.read_bytes()
    return None


def marked(data: bytes) -> str:
    """Return the key in a complete result; empty if it has none or is incomplete."""
    if data[:2] == GZIP:
        try:
            data = svg_text(data, "").encode()
        except ImageError:
            return ""
    if data.endswith(TAIL):
        return read_metadata(data[:HEAD].decode("utf-8", "replace"))
    return picture_key(data)


def not_ours(jobs: Iterable[Job], manifest: Manifest) -> list[Path]:
    """Return the existing files in place of results that warpsplat did not write."""
    found = []
    for job in jobs:
        if is_remote(job.output) and (not listed(job.output) or manifest.entries(job.output)):
            continue
        try:
            free = may_replace(job.output)
        except OSError:
            free = False
        if not free:
            data = read_result(job.output)
            entries = manifest.entries(job.output) if data is not None else []
            free = data is not None and any(entry.digest == digest(data) for entry in entries)
        if not free:
            found.append(job.output)
    return found


class Batch:
    """Runs jobs and keeps the manifest."""

    def __init__(
        self,
        jobs: list[Job],
        manifest: Manifest,
        *,
        on_report: Callable[[JobReport], None],
        retry: bool = False,
        threads: int | None = None,
        reports: Reports | None = None,
    ) -> None:
        """Args:
        jobs: what to do.
        manifest: open.
        on_report: called with what became of each job, as soon as that is known.
        retry: whether what failed is tried again.
        threads: of each task, on a CPU.
        reports: where pages on results are kept; None: none are made.
        """
        self.jobs, self.manifest = jobs, manifest
        self._on_report, self._retry, self._threads = on_report, retry, threads
        self._reports = reports
        self._made_before: dict[int, Entry] = {}
        """Manifest entries of results that exist and only lack a report."""
        self._keys: dict[int, str] = {}
        """Keys of the tasks in progress."""

    def run(self, executor: Executor, stop: Stop, advance: Advance) -> None:
        """Do the jobs. Wait for those claimed by another process, and do them if it dies.

        Raises:
            OutputError: the manifest cannot be written.
            ResourceError: there are no workers.
        """
        todo, waiting = list(range(len(self.jobs))), False
        while todo and not stop():
            later: list[int] = []
            for outcome in executor.run(self._tasks(todo, later, stop), stop, advance):
                advance(outcome.number, 1.0)
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
            if self._inputs(number) is not None:
                self._on_report(JobReport(job, "planned"))

    def _tasks(self, todo: list[int], later: list[int], stop: Stop) -> Iterator[Task]:
        """Claim the jobs ``todo`` and yield their tasks; append those claimed by others to ``later``."""
        for number in todo:
            if stop():
                return
            job = self.jobs[number]
            found = self._inputs(number)
            if stop():
                self._on_report(JobReport(job, "stopped"))
                return
            if found is None:
                continue
            if not self.manifest.claim(job.output, found.key):
                later.append(number)
                continue
            # The previous holder of the claim may have made it.
            self.manifest.refresh()
            state = self._known(job, found.key)
            if state is None:
                self.manifest.release(job.output, found.key)
                continue
            self._keys[number] = found.key
            if state.made and state.entry:
                self._made_before[number] = state.entry
            yield self._task(number, found, measure=state.made)

    def _inputs(self, number: int) -> JobInputs | None:
        """Return a job's inputs; None, after a report, if nothing is to be done."""
        job = self.jobs[number]
        try:
            found = read_inputs(job)
        except Exception as error:
            self._on_report(JobReport(job, "failed", error=failure(error, str(job.image), str(job.output))))
            return None
        return found if self._known(job, found.key) else None

    def _known(self, job: Job, key: str) -> ResultState | None:
        """Return the state of a result; None, after a report, if nothing is to be done."""
        state = result_state(job, key, self.manifest)
        reported = not (self._reports and self._reports.lacks(job.output))
        if state.made and (is_picture(job.output) or (state.entry and reported)):  # pictures are not measured
            self._on_report(JobReport(job, "skipped", state.entry.figures if state.entry else {}))
            return None
        if not state.made and state.entry and not self._retry:
            self._on_report(JobReport(job, "failed", error=state.entry.error, before=True))
            return None
        return state

    def _task(self, number: int, found: JobInputs, *, measure: bool) -> Task:
        job = self.jobs[number]
        away = is_remote(job.output)
        return Task(
            number,
            found.image if is_remote(job.image) else str(job.image),
            str(job.image),
            str(job.output),
            job.settings,
            job.device,
            self._threads,
            self._mask(job, found),
            # A result without a key in it is known by its digest, which is noted before it is written; a
            # picture is drawn once, for both.
            bring=away or job.settings.minify or is_picture(job.output),
            measure=measure,
            result=read_result(job.output) if measure and away else None,
            report=self._report_request(number),
        )

    def _report_request(self, number: int) -> ReportRequest | None:
        if self._reports is None:
            return None
        before = self._made_before.get(number)
        back = self._reports.link_to_index(self.jobs[number].output)
        return ReportRequest(back, before.figures if before else {})

    def _mask(self, job: Job, found: JobInputs) -> Source | None:
        if job.importance is None:
            return None
        return found.mask if is_remote(job.importance) else str(job.importance)

    def _settle(self, outcome: Outcome) -> None:
        """Write a result if the worker did not, and note and report the outcome."""
        job, key = self.jobs[outcome.number], self._keys.pop(outcome.number)
        before = self._made_before.pop(outcome.number, None)
        status: Status = "skipped" if outcome.status == "measured" else outcome.status
        error = outcome.error
        try:
            if outcome.data is not None:
                self._note(job, outcome, "writing")
                make_folder(job.output.parent)
                write_result(job.output, outcome.data)
            if outcome.status in ("made", "measured") and not before:
                self._note(job, outcome, "made")
        except OutputError as failed:
            status, error = "failed", failure(failed, str(job.image), str(job.output))
        if status == "failed" and outcome.key:
            with contextlib.suppress(OutputError):  # reported once is enough
                self.manifest.append(
                    Entry(
                        self.manifest.name(job.output),
                        outcome.key,
                        "failed",
                        image=str(job.image),
                        error=error,
                    )
                )
        if self._reports and status != "failed":
            self._reports.keep(job.output, outcome)
        self.manifest.release(job.output, key)
        self._on_report(JobReport(job, status, before.figures if before else outcome.figures, error))

    def _note(self, job: Job, outcome: Outcome, event: Literal["made", "writing"]) -> None:
        name, image = self.manifest.name(job.output), str(job.image)
        key = (
            STOPPED if outcome.status == "stopped" else outcome.key
        )  # written by us, but not the job's result
        self.manifest.append(Entry(name, key, event, outcome.digest, image, figures=outcome.figures))
