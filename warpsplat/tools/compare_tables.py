"""Tables of a comparison."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict

from warpsplat._version import __version__
from warpsplat.tools.compare import OURS, Comparison, ComparisonRow
from warpsplat.tools.tracer import TracerOptions

Figures = dict[str, float | None]
"""Figures of a row, or means; None if unknown."""


def _decimals(count: int, per: float = 1.0) -> Callable[[float], str]:
    return lambda value: f"{value / per:.{count}f}"


def _decibels(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "exact"


COLUMNS: dict[str, tuple[str, Callable[[float], str]]] = {
    "psnr": ("PSNR [dB]", _decibels),
    "ssim": ("SSIM", _decimals(3)),
    "ssimulacra2": ("SSIMULACRA2", _decimals(1)),
    "bytes": ("kB", _decimals(1, 1000)),
    "gzip_bytes": ("kB gzipped", _decimals(1, 1000)),
    "paths": ("paths", _decimals(0)),
    "nodes": ("nodes", _decimals(0)),
    "seconds": ("s", _decimals(1)),
    "cpu_seconds": ("CPU s", _decimals(1)),
}
"""Figures of a table: heading, and how a value is written."""


def figures(row: ComparisonRow) -> Figures:
    """Return the figures of a row; none if it failed."""
    if row.score is None:
        return {}
    return {**asdict(row.score), "seconds": row.seconds, "cpu_seconds": row.cpu_seconds}


def means(found: Comparison) -> list[tuple[str, str, Figures]]:
    """Return program, setting and mean figures of the settings that succeeded on every image."""
    count = len(found.by_image())
    groups: dict[tuple[str, str], list[Figures]] = {}
    for row in found.rows:
        groups.setdefault((row.program, row.setting), []).append(figures(row))
    entries = []
    for names, group in groups.items():
        if len(group) == count and all(group):
            columns = {name: [values[name] for values in group] for name in COLUMNS}
            entries.append((*names, {name: _mean(values) for name, values in columns.items()}))
    return entries


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if len(known) == len(values) else None


def table(entries: Sequence[tuple[str, str, Figures]]) -> str:
    """Return a Markdown table; columns without figures are left out."""
    shown = [name for name in COLUMNS if any(values.get(name) is not None for *_, values in entries)]
    cells = [["program", "setting", *(COLUMNS[name][0] for name in shown)]]
    for program, setting, values in entries:
        numbers = [(values.get(name), COLUMNS[name][1]) for name in shown]
        cells.append([program, setting, *("-" if v is None else write(v) for v, write in numbers)])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    rule = ["-" * w if i < 2 else "-" * (w - 1) + ":" for i, w in enumerate(widths)]
    return "\n".join(_line(line, widths) for line in (cells[0], rule, *cells[1:]))


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Return a line of a table: two columns of words, then numbers."""
    words = map(str.ljust, cells[:2], widths[:2])
    numbers = map(str.rjust, cells[2:], widths[2:])
    return f"| {' | '.join([*words, *numbers])} |"


def markdown(found: Comparison) -> str:
    """Return all tables: each image, the means of several, and the meaning of settings."""
    parts = []
    images = found.by_image()
    for image, rows in images.items():
        parts += [f"## {image}", table([(row.program, row.setting, figures(row)) for row in rows])]
        parts += [f"{row.program}, {row.setting}: {row.error}" for row in rows if row.error]
    if len(images) > 1:
        parts += [f"## Mean of {len(images)} images", table(means(found))]
    ours, tracer = found.settings, found.tracer
    lines = [
        f"* {OURS} {__version__}: the number of {ours.kind.name.lower()}s; {ours.iterations} steps, "
        f"seed {ours.seed}",
        f"* {tracer.name} {tracer.version}, options other than the defaults:",
        *(f"  * {name}: {options_text(options)}" for name, options in tracer.settings.items()),
    ]
    return "\n\n".join([*parts, "## Settings", "\n".join(lines)])


def options_text(options: TracerOptions) -> str:
    """Return a tracer's options as text."""
    return ", ".join(f"{name} {value}" for name, value in options.items()) or "none"
