"""Tables and a plot of a comparison."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from warpsplat._version import __version__
from warpsplat.tools.compare import OURS, Comparison, Row
from warpsplat.tools.tracer import Options, require

Figures = dict[str, float | None]
"""Of one row, or means; None where there are none."""


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


def figures(row: Row) -> Figures:
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
    """Return aligned Markdown; columns without any figure are left out."""
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


def options_text(options: Options) -> str:
    """Return a tracer's options as text."""
    return ", ".join(f"{name} {value}" for name, value in options.items()) or "none"


PANEL = (5.0, 3.8)
"""Width and height of an image's part of the plot [inches of 72 px]."""

ACROSS = 2
"""Most panels in a row."""


def plot(found: Comparison) -> bytes:
    """PSNR against the size of the file, one panel an image, as an SVG.

    Raises:
        UsageError: Matplotlib is not installed.
    """
    matplotlib = require("matplotlib")
    figure_module = require("matplotlib.figure")
    images = found.by_image()
    across = min(ACROSS, len(images))
    down = math.ceil(len(images) / across)
    # Text stays text, and the same rows give the same bytes.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": OURS}):
        figure = figure_module.Figure((PANEL[0] * across, PANEL[1] * down), layout="constrained")
        for i, (image, rows) in enumerate(images.items()):
            axes = figure.add_subplot(down, across, i + 1)
            draw_panel(axes, image, rows, found.tracer.name)
        file = io.BytesIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


def draw_panel(axes: Any, image: str, rows: Sequence[Row], tracer: str) -> None:
    """Draw the panel of an image: our numbers of shapes as a line, the tracer's settings as points."""
    for program, style in ((OURS, "o-"), (tracer, "s")):
        points = [
            (row.score.bytes / 1000, row.score.psnr, row.setting)
            for row in rows
            if row.program == program and row.score and math.isfinite(row.score.psnr)
        ]
        axes.plot([x for x, _, _ in points], [y for _, y, _ in points], style, markersize=4, label=program)
        for i, (x, y, setting) in enumerate(points):
            axes.annotate(setting, (x, y), (4, 4 if i % 2 else -9), textcoords="offset points", fontsize=7)
    axes.set_title(image, parse_math=False)
    axes.set(xscale="log", xlabel="file [kB]", ylabel="PSNR [dB]")
    axes.xaxis.set_major_locator(require("matplotlib.ticker").LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(
        ""
    )  # or they are labelled where there are few: as powers, one over the other
    axes.grid(visible=True, alpha=0.3)
    axes.tick_params(labelsize=8)
    axes.margins(0.15)
    axes.legend()
