"""Skeletons and the lines in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.trace.line_art import CROSS, TEE, drawn, shown, traced
from warpsplat.drawing.line_art import with_equal_widths
from warpsplat.drawing.strokes.chains import END, Arm, joined_arms
from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import CenterLine, trace_ink
from warpsplat.drawing.strokes.pens import find_pens
from warpsplat.drawing.strokes.skeleton import find_graph
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.svg.write import write_svg


def lines_of(paths: str) -> list[CenterLine]:
    return trace_ink(find_ink(drawn(paths))).lines


def away(line: CenterLine, start: tuple[float, float], end: tuple[float, float]) -> float:
    """Largest distance of a line's points from a straight one."""
    way = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    off = line.points - start
    return float(np.abs(off[:, 0] * way[1] - off[:, 1] * way[0]).max())


def test_a_skeleton_has_nodes_where_lines_meet_and_end() -> None:
    graph = find_graph(drawn(CROSS)[..., 0] < 0.5)
    assert sorted(len(edges) for edges in graph.at if edges) == [1, 1, 1, 1, 4]
    assert len(graph.edges) == 4
    assert graph.edges[0].half_width == pytest.approx(1.5, abs=1)


def test_burrs_are_no_lines() -> None:
    graph = find_graph(drawn('<path d="M15 36H80" stroke-width="14" stroke-linecap="butt"/>')[..., 0] < 0.5)
    assert len(graph.edges) == 1


def test_lines_go_straight_on_through_a_crossing() -> None:
    lines = lines_of(CROSS)
    assert len(lines) == 2
    ends = [((20, 12), (76, 60)), ((22, 58), (78, 16))]
    for start, end in ends:
        assert min(away(line, start, end) for line in lines) < 0.5


def test_a_line_that_ends_at_another_reaches_it() -> None:
    lines = sorted(lines_of(TEE), key=lambda line: float(np.ptp(line.points[:, 0])))
    assert len(lines) == 2
    stem = lines[0].points
    assert np.abs(stem[:, 0] - 48).max() < 0.35
    assert stem[:, 1].min() == pytest.approx(20, abs=1.2)


def test_a_ring_is_closed_and_its_width_known() -> None:
    (line,) = lines_of('<circle cx="48" cy="36" r="22"/>')
    assert line.closed
    assert np.hypot(*(line.points - (48, 36)).T) == pytest.approx(22, abs=0.6)
    assert line.width == pytest.approx(3, abs=0.1)


@pytest.mark.parametrize("width", [1.5, 2, 4, 6])
def test_widths_are_measured(width: float) -> None:
    (line,) = lines_of(f'<path d="M15 20Q50 5 80 55" stroke-width="{width}"/>')
    assert line.width == pytest.approx(width, abs=0.2)


def test_pens_are_told_apart_by_colour() -> None:
    colors = np.array([[0.1, 0.1, 0.1], [0.8, 0.1, 0.1], [0.16, 0.14, 0.1], [0.75, 0.15, 0.1]], np.float32)
    pens, owner = find_pens(colors, np.array([10.0, 30.0, 9.0, 20.0]))
    assert owner.tolist() == [1, 0, 1, 0]
    assert pens == pytest.approx(np.array([[0.8, 0.1, 0.1], [0.1, 0.1, 0.1]]), abs=0.06)


def test_each_pen_is_a_layer_of_opaque_strokes() -> None:
    scene = traced(drawn('<path d="M10 20H86"/><path d="M10 50H60" stroke="#c00"/>'))
    assert (scene.kind == Kind.STROKE).all()
    assert (scene.opacities == 1).all()
    assert scene.layer.tolist() == [0, 1]
    assert scene.colors == pytest.approx(np.array([[0, 0, 0], [0.8, 0, 0]]), abs=0.02)


def test_corners_are_kept() -> None:
    """A square of four lines: four cubics."""
    scene = traced(drawn('<rect x="20" y="12" width="50" height="44" stroke-linejoin="round"/>'))
    assert scene.closed.tolist() == [1]
    corners = scene.points[::3]
    for place in ((20, 12), (70, 12), (70, 56), (20, 56)):
        assert np.hypot(*(corners - place).T).min() < 1.2
    assert len(corners) <= 6


def test_an_area_is_filled_by_rings_of_the_pen() -> None:
    lines = '<path d="M4 5.5H92"/><path d="M4 66.5H92"/><path d="M60.5 12V62"/>'
    image = drawn(lines + '<path d="M8 16H50V56H8Z" fill="#000" stroke="none"/>')
    scene = traced(image)
    assert scene.widths.max() < 5
    painted = shown(write_svg(replace(scene, canvas=replace(scene.canvas, background=None)))) > 0.5
    assert painted[image[..., 0] < 0.5].mean() > 0.95
    assert (image[..., 0] < 0.5)[painted].mean() > 0.95


def test_a_disc_is_a_dot_however_broad() -> None:
    image = drawn('<path d="M4 5H92M60 12V62"/><circle cx="28" cy="36" r="20" fill="#000" stroke="none"/>')
    scene = traced(image)
    assert len(scene) == 3
    assert scene.widths.max() == pytest.approx(40, abs=0.3)


def test_no_ink_no_strokes() -> None:
    assert len(traced(np.ones((40, 50, 3), np.float32))) == 0


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


def test_arms_are_joined_by_the_least_bending_of_all() -> None:
    turns = np.radians([0, 90, 180, 200])
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    arms = [Arm(5 * way, way) for way in ways]
    pairs, cost = joined_arms(arms, [0] * 4)
    assert sorted(pairs) == [(0, 2), (1, 3)]
    assert cost == pytest.approx(np.radians(70) ** 2)
    assert joined_arms(arms, [0, 1, 2, 3]) == ([], 4 * END)
