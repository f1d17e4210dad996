"""The page that lists the images of a batch."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpsplat.batch.manifest import Manifest
from warpsplat.batch.plan import BatchJob
from warpsplat.batch.reports import Reports
from warpsplat.batch.run import JobOutcome
from warpsplat.errors import printable
from warpsplat.files.output import write_result
from warpsplat.files.remote import is_remote

NUMBERS = ("psnr", "bytes", "shapes", "seconds")
"""Figures that sums are made of or images sorted by."""


def write_index(
    reports: Reports, jobs: Sequence[BatchJob], outcomes: Mapping[Path, JobOutcome], manifest: Manifest
) -> None:
    """Write the list of ``jobs``, also of other processes; ``outcomes``: of this run, by output."""
    from warpsplat.pages.environment import page

    rows = [_row(reports, job, *_state(job, outcomes.get(job.output), manifest)) for job in jobs]
    most_thumbnails = 2000  # longer lists have no thumbnails: each is 3 kB
    if len(jobs) <= most_thumbnails:
        for job, row in zip(jobs, rows, strict=True):
            row["thumbnail"] = reports.thumbnail_of(job.output) if row["report"] else ""
    text = page("index.html.j2", assets=("index.css", "index.js"), totals=totals(rows), data={"rows": rows})
    write_result(reports.index, text.encode())


def _state(
    job: BatchJob, outcome: JobOutcome | None, manifest: Manifest
) -> tuple[str, Mapping[str, Any], str]:
    """Return a job's status, figures and error: of this run, else from the manifest."""
    if outcome:
        status = "made" if outcome.status == "skipped" else outcome.status
        return status, outcome.figures, outcome.error
    entries = [entry for entry in manifest.entries(job.output) if entry.event != "writing"]
    return (entries[-1].event, entries[-1].figures, entries[-1].error) if entries else ("open", {}, "")


def _row(
    reports: Reports, job: BatchJob, status: str, figures: Mapping[str, Any], error: str
) -> dict[str, Any]:
    """Return a job's row of the list."""
    there = status == "made" or (status == "stopped" and bool(figures))
    report = reports.report_of(job.output)
    return {
        "name": printable(str(job.image.name)),
        "folder": printable(str(job.image.parent)),
        "output": printable(job.output.name),
        "svg": _address(job.output, reports) if there else "",
        "report": _address(report, reports) if there and report.exists() else "",
        "status": status,
        "error": printable(error),
        "exact": figures.get("exact") is True,
        **{name: figures.get(name) for name in NUMBERS},
    }


def _address(path: Path, reports: Reports) -> str:
    """Return a relative link from the list to a file; empty if there is none."""
    from warpsplat.pages.environment import address

    if is_remote(path):
        return ""
    try:
        return address(Path(os.path.relpath(path, reports.index.parent)).as_posix())
    except ValueError:  # on another drive
        return ""


def totals(rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Return figures of all images: name, value, unit."""
    counts = {name: sum(row["status"] == name for row in rows) for name in ("made", "failed")}
    found = [("Images", str(len(rows)), ""), ("Made", str(counts["made"]), "")]
    if counts["failed"]:
        found.append(("Failed", str(counts["failed"]), ""))
    for name, title, scale, form, unit in (
        ("psnr", "Mean PSNR", 1, ".2f", "dB"),
        ("bytes", "Size", 1000, ".1f", "kB"),
        ("seconds", "Time", 1, ".1f", "s"),
    ):
        values = [row[name] / scale for row in rows if row[name] is not None]
        if values:
            value = sum(values) / (len(values) if name == "psnr" else 1)
            found.append((title, format(value, form), unit))
    return found
