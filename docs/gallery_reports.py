"""The reports of the gallery, made of its images, SVGs and records when the site is built."""

from __future__ import annotations

from functools import cache

from gallery import Entry, entries

from warpsplat.fit.progress import Progress
from warpsplat.pages.reports.single import Facts, report_page
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import start_warp


@cache  # `mkdocs serve` builds the site again at every change
def reports() -> dict[str, str]:
    """Pages by their names, below ``docs``."""
    start_warp()
    backend = Backend.on("cpu")
    return {f"gallery/{entry.report}": report(entry, backend) for entry in entries()}


def report(entry: Entry, backend: Backend) -> str:
    """The page on an entry."""
    figures = entry.figures()
    return report_page(
        entry.svg.read_text("utf-8"),
        entry.image.read_bytes(),
        backend,
        Facts(figures, history(entry), entry.command),
        name=entry.image.name,
        svg_name=entry.svg.name,
        back=f"../{entry.subject}/",
    )


def history(entry: Entry) -> list[Progress]:
    """The reports of the run that the record kept."""
    kept = entry.figures()["history"]
    rows = [dict(zip(kept, values, strict=True)) for values in zip(*kept.values(), strict=True)]
    last = rows[-1]["step"] if rows else 1
    return [Progress(**row, steps=last, work=row["step"] / last) for row in rows]
