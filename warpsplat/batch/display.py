"""Print the progress of a batch: a line for each image that is done, a bar, and a table at the end."""

from __future__ import annotations

import json
import shutil
import sys
import time
from pathlib import Path
from statistics import fmean, median

import click

from warpsplat.batch.results import MOST_NAMES
from warpsplat.batch.run import JobOutcome
from warpsplat.cli.echo import echo
from warpsplat.cli.run import summary
from warpsplat.errors import counted, printable
from warpsplat.fit.settings import SUBJECTS
from warpsplat.run.formats import is_picture

CLEAR = "\r\x1b[2K"
"""Clears the line of a terminal."""

SHOWN = ("made", "skipped", "failed")
"""Statuses whose counts are always in a summary; others are if they are not 0."""


class BatchDisplay:
    """Prints the progress and summary of a batch."""

    def __init__(self, total: int, *, quiet: bool, as_json: bool) -> None:
        self._total, self._quiet, self._as_json = total, quiet, as_json
        self._bar = sys.stderr.isatty() and not quiet
        self._progress: dict[int, float] = {}
        """Fraction of each job that is done."""
        self._begun: float | None = None
        self._counts = dict.fromkeys((*SHOWN, "stopped", "planned"), 0)
        self._psnr: list[float] = []
        """PSNR of each image [dB], except those that are reproduced exactly."""
        self._bytes: list[int] = []
        self._seconds: list[float] = []
        """Time of each image that was made now."""
        self.failures: list[str] = []
        """Images that failed; each cause is in a line of its own."""
        self.missed = False
        """Whether an image that was made now misses a goal."""

    @property
    def _seen(self) -> int:
        return sum(self._counts.values())

    def _count(self, outcome: JobOutcome) -> None:
        self._counts[outcome.status] += 1
        if outcome.error:
            self.failures.append(printable(str(outcome.job.image)))
        figures = outcome.figures
        for name, values in (("psnr", self._psnr), ("bytes", self._bytes)):
            if figures.get(name) is not None:
                values.append(figures[name])
        if outcome.status == "made":
            self._seconds.append(figures.get("seconds", 0.0))
            self.missed |= bool(figures.get("missed"))

    def _shown_counts(self) -> dict[str, int]:
        counts = {**self._counts, "not started": self._total - self._seen}
        return {name: n for name, n in counts.items() if n or name in SHOWN}

    def add(self, outcome: JobOutcome) -> None:
        """Show the outcome of a job."""
        self._count(outcome)
        if self._bar:
            click.echo(CLEAR, nl=False, err=True)
        if self._as_json:
            echo(json.dumps(outcome.as_dict()))
        count = f"[{self._seen}/{self._total}]"
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
        width = min(30, max(0, shutil.get_terminal_size().columns - 50))
        full = round(width * self._seen / self._total)
        failed = f", {len(self.failures)} failed" if self.failures else ""
        left = self._seconds_left()
        time_left = "" if left is None else f", {left // 60}:{left % 60:02} left"
        bar = f"{CLEAR}[{'#' * full}{'-' * (width - full)}] {self._seen}/{self._total}{failed}{time_left}"
        click.echo(bar, nl=False, err=True)

    def _seconds_left(self) -> int | None:
        """Estimate the remaining time from the rate so far; None before any work."""
        done = sum(self._progress.values())
        if self._begun is None or not done:
            return None
        begun = sum(fraction for fraction in self._progress.values() if fraction < 1)
        rate = done / (time.monotonic() - self._begun)
        return round(max(0.0, self._total - self._seen - begun) / rate)

    def finish(self, elapsed: float, workers: int, manifest: Path) -> None:
        """Print the summary of a batch that took ``elapsed`` seconds."""
        if self._bar:
            click.echo(CLEAR, nl=False, err=True)
        counts = self._shown_counts()
        if self._as_json:
            values = {
                "images": self._total,
                **{name.replace(" ", "_"): n for name, n in counts.items()},
                "psnr_mean": round(fmean(self._psnr), 3) if self._psnr else None,
                "psnr_median": round(median(self._psnr), 3) if self._psnr else None,
                "bytes": sum(self._bytes),
                "seconds": round(sum(self._seconds), 3),
                "elapsed": round(elapsed, 2),
                "workers": workers,
                "manifest": str(manifest),
            }
            echo(json.dumps(values))
        elif not self._quiet:
            did = ", ".join(f"{n} {name}" for name, n in counts.items())
            by = f", {counted(workers, 'worker')}" if workers > 1 else ""
            echo(f"{counted(self._total, 'image')}: {did} ({elapsed:.1f} s{by})")
            for row in self._table():
                echo("  ".join([f"  {row[0]:9}", *(f"{cell:>9}" for cell in row[1:])]).rstrip())
        if self._quiet:
            return
        if "not started" in counts:
            echo("warpsplat: interrupted; the same command goes on with the rest", err=True)
        if self.failures:
            rest = len(self.failures) - MOST_NAMES
            more = [f"and {rest} more"] if rest > 0 else []
            for text in ("failed:", *(f"  {error}" for error in [*self.failures[:MOST_NAMES], *more])):
                echo(text, err=True)

    def _table(self) -> list[tuple[str, ...]]:
        """Return rows: name, mean, median, sum; none if nothing is known."""
        rows: list[tuple[str, ...]] = [("", "mean", "median", "sum")]
        if self._psnr:
            rows.append(("PSNR [dB]", f"{fmean(self._psnr):.2f}", f"{median(self._psnr):.2f}", ""))
        for name, values, scale in (("size [kB]", self._bytes, 1000), ("time [s]", self._seconds, 1)):
            if values:
                row = (function(values) / scale for function in (fmean, median, sum))
                rows.append((name, *(f"{value:.1f}" for value in row)))
        return rows if len(rows) > 1 else []


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
    return "; ".join([summary(output, dict(figures)) + taken, *figures.get("notes", ())])
