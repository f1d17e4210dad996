"""Figures of all images of a batch."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import fmean, median
from typing import Any

from warpsplat.batch.run import JobOutcome

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
