"""Figures of all images of a batch."""

from __future__ import annotations

import statistics
from dataclasses import dataclass, field
from typing import Any

from warpsplat.batch.run import JobReport

COUNTED = ("made", "skipped", "failed")
"""Always in a summary."""

RARE = ("stopped", "planned")
"""In a summary if there are some."""


@dataclass
class Totals:
    """Sums over the reports so far."""

    asked: int
    """Images of the batch."""
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys((*COUNTED, *RARE), 0))
    psnr: list[float] = field(default_factory=list)
    """Of each image that has one [dB]; of one that is shown exactly there is none."""
    bytes: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    """That each took that was made now."""
    failures: list[str] = field(default_factory=list)
    missed: bool = False
    """Whether an image that was made now misses a goal."""

    def add(self, report: JobReport) -> None:
        """Count a report."""
        self.counts[report.status] += 1
        if report.error:
            self.failures.append(report.error)
        figures = report.figures
        for name, values in (("psnr", self.psnr), ("bytes", self.bytes)):
            if figures.get(name) is not None:
                values.append(figures[name])
        if report.status == "made":
            self.seconds.append(figures.get("seconds", 0.0))
            self.missed |= bool(figures.get("missed"))

    def shown_counts(self) -> dict[str, int]:
        """Return the counts to show."""
        counts = {**self.counts, "not started": self.not_started}
        return {name: n for name, n in counts.items() if n or name in COUNTED}

    @property
    def not_started(self) -> int:
        """Images that an interrupted batch did not get to."""
        return self.asked - sum(self.counts.values())

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "images": self.asked,
            **{name.replace(" ", "_"): n for name, n in self.shown_counts().items()},
            "psnr_mean": _rounded(statistics.fmean(self.psnr)) if self.psnr else None,
            "psnr_median": _rounded(statistics.median(self.psnr)) if self.psnr else None,
            "bytes": sum(self.bytes),
            "seconds": _rounded(sum(self.seconds)),
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Return a table: name, mean, median, sum."""
        rows: list[tuple[str, ...]] = [("", "mean", "median", "sum")]
        if self.psnr:
            mean, median = statistics.fmean(self.psnr), statistics.median(self.psnr)
            rows.append(("PSNR [dB]", f"{mean:.2f}", f"{median:.2f}", ""))
        for name, values, scale in (("size [kB]", self.bytes, 1000), ("time [s]", self.seconds, 1)):
            if values:
                mean, median, total = statistics.fmean(values), statistics.median(values), sum(values)
                rows.append((name, *(f"{value / scale:.1f}" for value in (mean, median, total))))
        return rows if len(rows) > 1 else []


def _rounded(value: float) -> float:
    return round(value, 3)
