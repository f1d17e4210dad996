"""Show a batch: a line for each image when it is done, a progress bar, and a table at the end."""

from __future__ import annotations

import json
import shutil
import sys
import time
from pathlib import Path

import click

from warpsplat.batch.run import JobReport
from warpsplat.batch.totals import Totals
from warpsplat.cli.echo import echo
from warpsplat.cli.run import SUBJECTS, summary
from warpsplat.errors import printable
from warpsplat.run.formats import is_picture

NAMED = 20
"""Maximum number of files that one message names."""

CLEAR = "\r\x1b[2K"
"""Clears the line of a terminal."""

WIDTH = 30
"""Width of the bar [characters]."""


class Show:
    """Prints the progress of a batch."""

    def __init__(self, total: int, *, quiet: bool, as_json: bool) -> None:
        self.totals = Totals(total)
        self._total, self._quiet, self._as_json = total, quiet, as_json
        self._bar = sys.stderr.isatty() and not quiet
        self._parts: dict[int, float] = {}
        self._begun: float | None = None
        self._seen = 0

    def add(self, report: JobReport) -> None:
        """Show what became of a job."""
        self.totals.add(report)
        self._seen += 1
        if self._bar:
            click.echo(CLEAR, nl=False, err=True)
        if self._as_json:
            echo(json.dumps(report.as_dict()))
        count = f"[{self._seen}/{self._total}]"
        if report.error:
            again = " (in an earlier run; --retry-failed tries again)" if report.before else ""
            echo(f"{count} failed: {report.error}{again}", err=True)
        elif not self._quiet and not self._as_json:
            echo(f"{count} {line(report)}")
        for goal in report.figures.get("missed", ()) if report.status == "made" else ():
            echo(f"{count} goal missed: {goal}", err=True)
        self._draw()

    def advance(self, number: int, part: float) -> None:
        """Update the fraction of a job that is done."""
        self._begun = self._begun or time.monotonic()
        self._parts[number] = part
        self._draw()

    def _draw(self) -> None:
        if not self._bar:
            return
        counts = self.totals.counts
        width = min(WIDTH, max(0, shutil.get_terminal_size().columns - 50))
        full = round(width * self._seen / self._total)
        failed = f", {counts['failed']} failed" if counts["failed"] else ""
        left = self._seconds_left()
        time_left = "" if left is None else f", {left // 60}:{left % 60:02} left"
        bar = f"{CLEAR}[{'#' * full}{'-' * (width - full)}] {self._seen}/{self._total}{failed}{time_left}"
        click.echo(bar, nl=False, err=True)

    def _seconds_left(self) -> int | None:
        """Estimate the remaining time from the rate so far; None before any work."""
        done = sum(self._parts.values())
        if self._begun is None or not done:
            return None
        in_work = sum(part for part in self._parts.values() if part < 1)
        rate = done / (time.monotonic() - self._begun)
        return round(max(0.0, self._total - self._seen - in_work) / rate)

    def finish(self, elapsed: float, workers: int, manifest: Path) -> None:
        """Sum up a batch that took ``elapsed`` seconds."""
        if self._bar:
            click.echo(CLEAR, nl=False, err=True)
        if self._as_json:
            rest = {"elapsed": round(elapsed, 2), "workers": workers, "manifest": str(manifest)}
            echo(json.dumps({**self.totals.as_dict(), **rest}))
        elif not self._quiet:
            counts = self.totals.shown_counts()
            did = ", ".join(f"{n} {name}" for name, n in counts.items())
            by = f", {workers} workers" if workers > 1 else ""
            echo(f"{self._total} images: {did} ({elapsed:.1f} s{by})")
            for row in self.totals.rows():
                echo("  ".join([f"  {row[0]:9}", *(f"{cell:>9}" for cell in row[1:])]).rstrip())
        if self.totals.not_started and not self._quiet:
            echo("warpsplat: interrupted; the same command goes on with the rest", err=True)
        failures = self.totals.failures
        if failures and not self._quiet:
            echo("failed:", err=True)
            for error in failures[:NAMED]:
                echo(f"  {error}", err=True)
            if len(failures) > NAMED:
                echo(f"  and {len(failures) - NAMED} more", err=True)


def line(report: JobReport) -> str:
    """Return one line about a job that did not fail."""
    output, figures = report.job.output, report.figures
    name = printable(str(output))
    if report.status == "skipped":
        psnr = f", {figures['psnr']:.2f} dB" if figures.get("psnr") is not None else ""
        size = f", {figures['bytes'] / 1000:.1f} kB" if figures.get("bytes") is not None else ""
        size += " as an SVG" if size and is_picture(output) else ""
        return f"{name}: already made with these settings{psnr}{size}"
    if report.status == "planned":
        return f"{name}: would be made of {printable(str(report.job.image))}"
    if not figures:
        return f"{name}: stopped, not made"
    subject = figures["subject"]
    taken = f", taken for a {SUBJECTS[subject]}" if figures["why"] and subject != "photo" else ""
    return summary(output, dict(figures)) + taken
