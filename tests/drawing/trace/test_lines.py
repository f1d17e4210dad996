"""Skeletons and the lines in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.trace.line_art import CROSS, drawn, traced
from warpsplat.drawing.line_art import with_equal_widths
from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import CenterLine, trace_ink
from warpsplat.scene import Canvas, Kind, Scene


def lines_of(paths: str) -> list[CenterLine]:
    return trace_ink(find_ink(drawn(paths))).lines


def away(line: CenterLine, start: tuple[float, float], end: tuple[float, float]) -> float:
    """Largest distance of a line's points from a straight one."""
    way = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    off = line.points - start
    return float(np.abs(off[:, 0] * way[1] - off[:, 1] * way[0]).max())


def test_lines_go_straight_on_through_a_crossing() -> None:
    lines = lines_of(CROSS)
    assert len(lines) == 2
    ends = [((20, 12), (76, 60)), ((22, 58), (78, 16))]
    for start, end in ends:
        assert min(away(line, start, end) for line in lines) < 0.5


@pytest.mark.parametrize("width", [1.5, 2, 4, 6])
def test_widths_are_measured(width: float) -> None:
    (line,) = lines_of(f'<path d="M15 20Q50 5 80 55" stroke-width="{width}"/>')
    assert line.width == pytest.approx(width, abs=0.2)


def test_corners_are_kept() -> None:
    """A square of four lines: four cubics."""
    scene = traced(drawn('<rect x="20" y="12" width="50" height="44" stroke-linejoin="round"/>'))
    assert scene.closed.tolist() == [1]
    corners = scene.points[::3]
    for place in ((20, 12), (70, 12), (70, 56), (20, 56)):
        assert np.hypot(*(corners - place).T).min() < 1.2
    assert len(corners) <= 6


LOOP = '<path d="M8 60C40 70 80 40 60 16C48 2 30 16 44 36C56 54 80 60 90 40"/>'
SPIRAL = (
    '<path d="M48 36C48 28 60 28 60 38C60 50 36 50 36 36C36 18 72 18 72 38C72 64 24 64 24 36"/>'
    '<path d="M6 20L92 48"/>'
)
SHARP = '<path d="M34 8L28 64M64 8L58 64M12 24H84M10 46H82"/>'
NET = "".join(f'<path d="M{10 + 9 * i} 64L{26 + 9 * i} 8M8 {14 + 10 * i}H88"/>' for i in range(5))


@pytest.mark.parametrize(
    ("paths", "count"),
    [
        (CROSS, 2),
        ('<path d="M6 30L90 42M6 42L90 30"/>', 2),
        (SHARP, 4),
        ('<circle cx="48" cy="36" r="22"/><path d="M10 50L86 20"/>', 2),
        ('<path d="M70 12H26V60H70M26 35H60" stroke-width="5" stroke-linejoin="round"/>', 2),
        ('<path d="M10 20H86M48 20V62"/>', 2),
        ('<path d="M20 12L76 60M22 58L78 16M48 8V66"/>', 3),
        ('<path d="M20 10L34 62L48 10L62 62L76 10"/>', 1),
        ('<path d="M28 62L48 10L68 62M35 44H61"/>', 2),
        ('<path d="M36 10L48 40L60 10M48 40V64"/>', 2),
        ('<path d="M10 50H86M30 50V34M50 50V36M70 50V28"/>', 4),
        ("".join(f'<path d="M{8 + 7 * i} 62L{28 + 7 * i} 10"/>' for i in range(9)), 9),
        (SPIRAL, 2),
        (LOOP, 1),
        (NET.replace("<path", '<path stroke-width="1.5"'), 10),
    ],
)
@pytest.mark.parametrize("is_grey", [True, False])
def test_each_drawn_line_is_one_stroke(paths: str, count: int, is_grey: bool) -> None:
    image = drawn(paths)
    scene = traced(image if is_grey else np.round(image))
    assert len(scene) == count
    if is_grey:
        assert np.ptp(scene.widths) < 0.4


def test_strokes_about_as_wide_have_one_width() -> None:
    points = np.array([[[8, y], [20, y], [35, y], [80, y]] for y in (10, 20, 30, 40)], np.float32)
    strokes = Scene.uniform(Kind.STROKE, Canvas(96, 72, None), points)
    strokes = replace(strokes, widths=np.array([3, 3.1, 2.9, 5], np.float32))
    assert with_equal_widths(strokes).widths == pytest.approx([3, 3, 3, 5], abs=1e-3)
