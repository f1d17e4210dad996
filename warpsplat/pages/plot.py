"""Plots of numbers over time: where lines and ticks lie; ``templates/plot.html.j2`` draws them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

WIDTH, HEIGHT = 420, 190
"""Of a plot [units of its view box]."""

LEFT, RIGHT, TOP, BOTTOM = 42, 10, 10, 34
"""What is kept free for the axes."""

MOST_POINTS = 400
"""Of a line: more cannot be told apart."""


@dataclass(frozen=True)
class Tick:
    """A number at an axis."""

    at: float
    """Where, across or down."""
    text: str


@dataclass(frozen=True)
class Line:
    """Part of a curve in one style."""

    points: str
    """As ``polyline`` takes them."""
    faint: bool


@dataclass(frozen=True)
class Mark:
    """A point of a curve that is drawn as a dot, with a text; to be placed, in the curve's own units."""

    x: float
    y: float
    text: str
    strong: bool = False
    """Whether it stands out."""


@dataclass(frozen=True)
class Plot:
    """What is drawn, in units of its view box."""

    title: str
    lines: tuple[Line, ...]
    across: tuple[Tick, ...]
    up: tuple[Tick, ...]
    across_label: str
    up_label: str
    marks: tuple[Mark, ...] = ()
    """In units of the view box."""
    area: str = ""
    """What lies below the lines, as ``polygon`` takes it; empty: nothing is filled."""
    width: int = WIDTH
    height: int = HEIGHT
    box: tuple[int, int, int, int] = (LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM)
    """Left, top, right, bottom of where lines are."""


def plot(
    title: str,
    xs: Sequence[float],
    ys: Sequence[float],
    labels: tuple[str, str],
    *,
    faint: Sequence[bool] = (),
    from_zero: bool = False,
    filled: bool = False,
    marks: Sequence[Mark] = (),
) -> Plot | None:
    """A curve; None where there are fewer than two points that are numbers.

    Args:
        title: what it shows.
        xs: ascending.
        ys: as many.
        labels: of the axes, the one that goes across first.
        faint: which points are of another kind, drawn weaker.
        from_zero: whether the axis that goes up begins at 0.
        filled: whether the area below is.
        marks: points of it to be marked.
    """
    flags = list(faint) or [False] * len(xs)
    found = [
        (x, y, flag)
        for x, y, flag in zip(xs, ys, flags, strict=True)
        if math.isfinite(x) and math.isfinite(y)
    ]
    if len(found) < 2 or found[-1][0] <= found[0][0]:
        return None
    found = _thinned(found)
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    low, high = min(y for _, y, _ in found), max(y for _, y, _ in found)
    up = ticks(0.0 if from_zero else low, high, 5)
    across = ticks(0.0, found[-1][0], 6)
    low, high = min(low, up[0]), max(high, up[-1])
    end = found[-1][0]

    def x_of(value: float) -> float:
        return LEFT + (right - LEFT) * value / end

    def y_of(value: float) -> float:
        return bottom - (bottom - TOP) * (value - low) / ((high - low) or 1.0)

    placed = [(x_of(x), y_of(y), flag) for x, y, flag in found]
    area = ""
    if filled:
        area = _points([(placed[0][0], bottom), *((x, y) for x, y, _ in placed), (placed[-1][0], bottom)])
    return Plot(
        title,
        tuple(_lines(placed)),
        tuple(Tick(x_of(value), number(value)) for value in across if value <= end * 1.0001),
        tuple(Tick(y_of(value), number(value)) for value in up),
        *labels,
        marks=tuple(replace(mark, x=x_of(mark.x), y=y_of(mark.y)) for mark in marks),
        area=area,
    )


def _thinned(points: list[tuple[float, float, bool]]) -> list[tuple[float, float, bool]]:
    if len(points) <= MOST_POINTS:
        return points
    step = (len(points) - 1) / (MOST_POINTS - 1)
    return [points[round(i * step)] for i in range(MOST_POINTS)]


def _lines(points: list[tuple[float, float, bool]]) -> list[Line]:
    """Runs of one style. Between two of them is a gap: what they say cannot be compared."""
    runs: list[list[tuple[float, float, bool]]] = []
    for point in points:
        if runs and runs[-1][-1][2] == point[2]:
            runs[-1].append(point)
        else:
            runs.append([point])
    # A point alone is a line of no length, whose caps are a dot.
    return [
        Line(_points([(x, y) for x, y, _ in (run * 2 if len(run) == 1 else run)]), run[0][2]) for run in runs
    ]


def _points(points: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def ticks(low: float, high: float, count: int) -> list[float]:
    """About ``count`` round numbers that enclose ``low`` and ``high``."""
    span = (high - low) or abs(high) or 1.0
    rough = span / max(1, count - 1)
    unit = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * unit for factor in (1, 2, 5, 10) if factor * unit >= rough * 0.999)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [round(step * i, 10) for i in range(first, max(last, first + 1) + 1)]


def number(value: float) -> str:
    """As it stands at an axis."""
    return f"{value:,.0f}".replace(",", "\N{THIN SPACE}") if abs(value) >= 1000 else f"{value:g}"
