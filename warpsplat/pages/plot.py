"""Layout of plots, which ``templates/plot.html.j2`` draws."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

WIDTH, HEIGHT = 420, 190
"""Size of a plot [units of its view box]."""

LEFT, TOP, RIGHT, BOTTOM = 42, 10, 410, 156
"""Box of the curve, inside the space for the axes."""


class Mark(NamedTuple):
    """A labelled dot on a curve."""

    x: float
    y: float
    text: str
    strong: bool = False


@dataclass(frozen=True)
class Plot:
    """A plot, in units of its view box."""

    title: str
    labels: tuple[str, str]
    """Labels of the horizontal and the vertical axis."""
    lines: list[tuple[str, bool]]
    """Parts of the curve, as the points of a ``polyline``, and whether they are faint."""
    across: list[tuple[float, str]]
    """Ticks of the horizontal axis: place and text."""
    up: list[tuple[float, str]]
    """Ticks of the vertical axis."""
    marks: list[Mark]
    area: str
    """The filled area, as the points of a ``polygon``; empty if there is none."""
    size: tuple[int, int] = (WIDTH, HEIGHT)
    box: tuple[int, int, int, int] = (LEFT, TOP, RIGHT, BOTTOM)


def plot(
    title: str,
    xs: Sequence[float],
    ys: Sequence[float],
    labels: tuple[str, str],
    *,
    faint: Sequence[bool] = (),
    filled: bool = False,
    marks: Sequence[Mark] = (),
) -> Plot | None:
    """Lay out a curve; return None if fewer than two points are finite.

    Args:
        title: title of the plot.
        xs: coordinates, ascending.
        ys: values, as many.
        labels: of the horizontal and the vertical axis.
        faint: which points are drawn faint, as they cannot be compared with the others.
        filled: whether the vertical axis begins at 0, and the area below the curve is filled.
        marks: points of the curve to be marked.
    """
    flags = list(faint) or [False] * len(xs)
    found = [p for p in zip(xs, ys, flags, strict=True) if math.isfinite(p[0]) and math.isfinite(p[1])]
    if len(found) < 2 or found[-1][0] <= found[0][0]:
        return None
    step = max(1.0, (len(found) - 1) / 399)  # more than 400 points cannot be told apart
    found = [found[round(i * step)] for i in range(min(len(found), 400))]
    low, high, end = min(p[1] for p in found), max(p[1] for p in found), found[-1][0]
    up, across = ticks(0.0 if filled else low, high, 5), ticks(0.0, end, 6)
    low, high = min(low, up[0]), max(high, up[-1])

    def place(x: float, y: float) -> tuple[float, float]:
        return LEFT + (RIGHT - LEFT) * x / end, BOTTOM - (BOTTOM - TOP) * (y - low) / (high - low)

    placed = [place(x, y) for x, y, _ in found]
    lines = []
    for flag, group in itertools.groupby(zip(found, placed, strict=True), key=lambda pair: pair[0][2]):
        run = [point for _, point in group]
        lines.append((_points(run * 2 if len(run) == 1 else run), flag))  # a single point becomes a dot
    area = [(placed[0][0], BOTTOM), *placed, (placed[-1][0], BOTTOM)] if filled else []
    return Plot(
        title,
        labels,
        lines,
        [(place(value, low)[0], number(value)) for value in across if value <= end * 1.0001],
        [(place(0.0, value)[1], number(value)) for value in up],
        [Mark(*place(mark.x, mark.y), mark.text, mark.strong) for mark in marks],
        _points(area),
    )


def _points(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def ticks(low: float, high: float, count: int) -> list[float]:
    """Return about ``count`` round numbers that enclose ``low`` and ``high``."""
    span = (high - low) or abs(high) or 1.0
    rough = span / max(1, count - 1)
    unit = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * unit for factor in (1, 2, 5, 10) if factor * unit >= rough * 0.999)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(step * i, 10) for i in range(first, max(last, first + 1) + 1)]


def number(value: float) -> str:
    """Return a number as an axis shows it."""
    return f"{value:,.0f}".replace(",", "\N{THIN SPACE}") if abs(value) >= 1000 else f"{value:g}"
