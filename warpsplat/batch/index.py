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

ASSETS = ("index.css", "index.js")

MOST_THUMBNAILS = 2000
"""Longer lists have no thumbnails: each is 3 kB."""

FIGURES = ("psnr", "bytes", "shapes", "seconds")
"""Figures that images can be sorted by, besides their names."""


class Index:
    """Collects the outcomes of a batch's jobs, and writes the page that lists them."""

    def __init__(self, jobs: Sequence[BatchJob], reports: Reports) -> None:
        """``jobs``: all of them, also those that other processes do."""
        self._jobs, self._reports = jobs, reports
        self._outcomes: dict[Path, JobOutcome] = {}

    def add(self, outcome: JobOutcome) -> None:
        """Keep the outcome of a job."""
        self._outcomes[outcome.job.output] = outcome

    def write(self, manifest: Manifest) -> None:
        """Write the current list.

        Raises:
            OutputError: it cannot be written.
        """
        with_thumbnails = len(self._jobs) <= MOST_THUMBNAILS
        rows = [self._row(job, manifest, with_thumbnail=with_thumbnails) for job in self._jobs]
        from warpsplat.pages import page

        text = page("index.html.j2", assets=ASSETS, totals=totals(rows), data={"rows": rows})
        write_result(self._reports.index, text.encode())

    def _row(self, job: BatchJob, manifest: Manifest, *, with_thumbnail: bool) -> dict[str, Any]:
        """Return a job's row of the list."""
        status, figures, error = self._state(job, manifest)
        there = status == "made" or (status == "stopped" and bool(figures))
        report = self._reports.report_of(job.output)
        return {
            "name": printable(str(job.image.name)),
            "folder": printable(str(job.image.parent)),
            "output": printable(job.output.name),
            "svg": self._address(job.output) if there else "",
            "report": self._address(report) if there and report.exists() else "",
            "thumbnail": self._reports.thumbnail_of(job.output) if there and with_thumbnail else "",
            "status": status,
            "error": printable(error),
            "exact": "psnr" in figures and figures["psnr"] is None and figures.get("ssim") == 1,
            **{name: figures.get(name) for name in FIGURES},
        }

    def _state(self, job: BatchJob, manifest: Manifest) -> tuple[str, Mapping[str, Any], str]:
        """Return a job's status, figures and error: of this run, else from the manifest."""
        outcome = self._outcomes.get(job.output)
        if outcome:
            status = "made" if outcome.status == "skipped" else outcome.status
            return status, outcome.figures, outcome.error
        entries = [entry for entry in manifest.entries(job.output) if entry.event != "writing"]
        if not entries:
            return "open", {}, ""
        return entries[-1].event, entries[-1].figures, entries[-1].error

    def _address(self, path: Path) -> str:
        """Return a relative link from the list to a file; empty if there is none."""
        if is_remote(path):
            return ""
        try:
            from warpsplat.pages.environment import address

            return address(Path(os.path.relpath(path, self._reports.index.parent)).as_posix())
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
