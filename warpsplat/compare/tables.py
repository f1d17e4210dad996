"""Tables of a comparison."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from statistics import fmean

from warpsplat._version import __version__
from warpsplat.compare.comparison import OURS, Comparison, ComparisonRow
from warpsplat.errors import counted

Figures = dict[str, float | None]
"""Figures of a row, or means; None if unknown."""


COLUMNS = {
    "psnr": ("PSNR [dB]", 1, ".2f"),
    "ssim": ("SSIM", 1, ".3f"),
    "ssimulacra2": ("SSIMULACRA2", 1, ".1f"),
    "bytes": ("kB", 1000, ".1f"),
    "gzip_bytes": ("kB gzipped", 1000, ".1f"),
    "paths": ("paths", 1, ".0f"),
    "nodes": ("nodes", 1, ".0f"),
    "seconds": ("s", 1, ".1f"),
    "cpu_seconds": ("CPU s", 1, ".1f"),
}
"""Figures of a table: heading, unit, format."""


def _written(name: str, value: float | None) -> str:
    _, unit, form = COLUMNS[name]
    return "-" if value is None else format(value / unit, form) if math.isfinite(value) else "exact"


def figures(row: ComparisonRow) -> Figures:
    """Return the figures of a row; none if it failed."""
    if row.score is None:
        return {}
    return {**asdict(row.score), "seconds": row.seconds, "cpu_seconds": row.cpu_seconds}


def means(found: Comparison) -> list[tuple[str, str, Figures]]:
    """Return program, setting and mean figures of the settings that succeeded on every image."""
    count = len({row.image for row in found.rows})
    groups: dict[tuple[str, str], list[Figures]] = {}
    for row in found.rows:
        groups.setdefault((row.program, row.setting), []).append(figures(row))
    return [
        (*names, {name: _mean([values[name] for values in group]) for name in COLUMNS})
        for names, group in groups.items()
        if len(group) == count and all(group)
    ]


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return fmean(known) if len(known) == len(values) else None


def table(entries: Sequence[tuple[str, str, Figures]]) -> str:
    """Return a Markdown table; columns without figures are left out."""
    shown = [name for name in COLUMNS if any(values.get(name) is not None for *_, values in entries)]
    cells = [["program", "setting", *(COLUMNS[name][0] for name in shown)]]
    for program, setting, values in entries:
        cells.append([program, setting, *(_written(name, values.get(name)) for name in shown)])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    cells.insert(1, ["-" * w if i < 2 else "-" * (w - 1) + ":" for i, w in enumerate(widths)])
    aligned = [[*map(str.ljust, line[:2], widths), *map(str.rjust, line[2:], widths[2:])] for line in cells]
    return "\n".join(f"| {' | '.join(line)} |" for line in aligned)


def markdown(found: Comparison) -> str:
    """Return all tables: each image, the means of several, and the meaning of settings."""
    parts = []
    images = dict.fromkeys(row.image for row in found.rows)
    for image in images:
        rows = [row for row in found.rows if row.image == image]
        parts += [f"## {image}", table([(row.program, row.setting, figures(row)) for row in rows])]
        parts += [f"{row.program}, {row.setting}: {row.error}" for row in rows if row.error]
    if len(images) > 1:
        parts += [f"## Mean of {counted(len(images), 'image')}", table(means(found))]
    ours, tracer = found.settings, found.tracer
    lines = [
        f"* {OURS} {__version__}: the number of {ours.kind.name.lower()}s; "
        f"{counted(ours.iterations, 'step')}, seed {ours.seed}",
        f"* {tracer.name} {tracer.version}, options other than the defaults:",
    ]
    for name, options in tracer.settings.items():
        text = ", ".join(f"{key} {value}" for key, value in options.items())
        lines.append(f"  * {name}: {text or 'none'}")
    return "\n\n".join([*parts, "## Settings", "\n".join(lines)])
