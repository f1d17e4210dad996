"""Print the progress of a batch: a line for each image that is done, a bar, and a table at the end."""

from __future__ import annotations

import json
import shutil
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, median
from typing import Any

import click

from warpsplat.batch.results import MOST_NAMES
from warpsplat.batch.run import JobOutcome
from warpsplat.cli.echo import echo
from warpsplat.cli.run import SUBJECTS, summary
from warpsplat.errors import printable
from warpsplat.run.formats import is_picture

CLEAR = "\r\x1b[2K"
"""Clears the line of a terminal."""

WIDTH = 30
"""Width of the bar [characters]."""


COUNTED = ("made", "skipped", "failed")
"""Counts that are always in a summary."""

RARE = ("stopped", "planned")
"""Counts that are in a summary if they are not 0."""


@dataclass
class Totals:
    """Sums over the outcomes so far."""

    requested: int
    """Number of images of the batch."""
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys((*COUNTED, *RARE), 0))
    psnr: list[float] = field(default_factory=list)
    """PSNR of each image [dB], except those that are reproduced exactly."""
    bytes: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    """Time of each image that was made now."""
    failures: list[str] = field(default_factory=list)
    missed: bool = False
    """Whether an image that was made now misses a goal."""

    def add(self, outcome: JobOutcome) -> None:
        """Count an outcome."""
        self.counts[outcome.status] += 1
        if outcome.error:
            self.failures.append(outcome.error)
        figures = outcome.figures
        for name, values in (("psnr", self.psnr), ("bytes", self.bytes)):
            if figures.get(name) is not None:
                values.append(figures[name])
        if outcome.status == "made":
            self.seconds.append(figures.get("seconds", 0.0))
            self.missed |= bool(figures.get("missed"))

    def shown_counts(self) -> dict[str, int]:
        """Return the counts to show."""
        counts = {**self.counts, "not started": self.not_started}
        return {name: n for name, n in counts.items() if n or name in COUNTED}

    @property
    def seen(self) -> int:
        """Number of images that have an outcome."""
        return sum(self.counts.values())

    @property
    def not_started(self) -> int:
        """Images that an interrupted batch did not get to."""
        return self.requested - self.seen

    def as_dict(self) -> dict[str, Any]:
        """Return the values for JSON."""
        return {
            "images": self.requested,
            **{name.replace(" ", "_"): n for name, n in self.shown_counts().items()},
            "psnr_mean": round(fmean(self.psnr), 3) if self.psnr else None,
            "psnr_median": round(median(self.psnr), 3) if self.psnr else None,
            "bytes": sum(self.bytes),
            "seconds": round(sum(self.seconds), 3),
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Return a table: name, mean, median, sum."""
        rows: list[tuple[str, ...]] = [("", "mean", "median", "sum")]
        if self.psnr:
            rows.append(("PSNR [dB]", f"{fmean(self.psnr):.2f}", f"{median(self.psnr):.2f}", ""))
        for name, values, scale in (("size [kB]", self.bytes, 1000), ("time [s]", self.seconds, 1)):
            if values:
                row = (function(values) / scale for function in (fmean, median, sum))
                rows.append((name, *(f"{value:.1f}" for value in row)))
        return rows if len(rows) > 1 else []


class BatchDisplay:
    """Prints the progress and summary of a batch."""

    def __init__(self, total: int, *, quiet: bool, as_json: bool) -> None:
        self.totals = Totals(total)
        self._total, self._quiet, self._as_json = total, quiet, as_json
        self._bar = sys.stderr.isatty() and not quiet
        self._progress: dict[int, float] = {}
        """Fraction of each job that is done."""
        self._begun: float | None = None

    def add(self, outcome: JobOutcome) -> None:
        """Show the outcome of a job."""
        self.totals.add(outcome)
        if self._bar:
            click.echo(CLEAR, nl=False, err=True)
        if self._as_json:
            echo(json.dumps(outcome.as_dict()))
        count = f"[{self.totals.seen}/{self._total}]"
        if outcome.error:
            again = " (in an earlier run; --retry-failed tries again)" if outcome.before else ""
            echo(f"{count} failed: {outcome.error}{again}", err=True)
        elif not self._quiet and not self._as_json:
            echo(f"{count} {line(outcome)}")
        for goal in outcome.figures.get("missed", ()) if outcome.status == "made" else ():
            echo(f"{count} goal missed: {goal}", err=True)
        self._draw_bar()

    def on_progress(self, number: int, fraction: float) -> None:
        """Update the fraction of a job that is done."""
        self._begun = self._begun or time.monotonic()
        self._progress[number] = fraction
        self._draw_bar()

    def _draw_bar(self) -> None:
        if not self._bar:
            return
        counts = self.totals.counts
        width = min(WIDTH, max(0, shutil.get_terminal_size().columns - 50))
        full = round(width * self.totals.seen / self._total)
        failed = f", {counts['failed']} failed" if counts["failed"] else ""
        left = self._seconds_left()
        time_left = "" if left is None else f", {left // 60}:{left % 60:02} left"
        bar = (
            f"{CLEAR}[{'#' * full}{'-' * (width - full)}] {self.totals.seen}/{self._total}{failed}{time_left}"
        )
        click.echo(bar, nl=False, err=True)

    def _seconds_left(self) -> int | None:
        """Estimate the remaining time from the rate so far; None before any work."""
        done = sum(self._progress.values())
        if self._begun is None or not done:
            return None
        begun = sum(fraction for fraction in self._progress.values() if fraction < 1)
        rate = done / (time.monotonic() - self._begun)
        return round(max(0.0, self._total - self.totals.seen - begun) / rate)

    def finish(self, elapsed: float, workers: int, manifest: Path) -> None:
        """Print the summary of a batch that took ``elapsed`` seconds."""
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
            for error in failures[:MOST_NAMES]:
                echo(f"  {error}", err=True)
            if len(failures) > MOST_NAMES:
                echo(f"  and {len(failures) - MOST_NAMES} more", err=True)


def line(outcome: JobOutcome) -> str:
    """Return one line about a job that did not fail."""
    output, figures = outcome.job.output, outcome.figures
    name = printable(str(output))
    if outcome.status == "skipped":
        psnr = f", {figures['psnr']:.2f} dB" if figures.get("psnr") is not None else ""
        size = f", {figures['bytes'] / 1000:.1f} kB" if figures.get("bytes") is not None else ""
        size += " as an SVG" if size and is_picture(output) else ""
        return f"{name}: already made with these settings{psnr}{size}"
    if outcome.status == "planned":
        return f"{name}: would be made of {printable(str(outcome.job.image))}"
    if not figures:
        return f"{name}: stopped, not made"
    subject = figures["subject"]
    taken = f", taken for a {SUBJECTS[subject]}" if figures["why"] and subject != "photo" else ""
    return summary(output, dict(figures)) + taken
