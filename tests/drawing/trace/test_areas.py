"""Filled areas and dots told apart from lines."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.trace.line_art import drawn
from warpsplat.drawing.strokes.areas import is_beside, split_areas, with_ends_in_areas
from warpsplat.drawing.strokes.centerlines import find_lines
from warpsplat.drawing.strokes.dots import round_dots
from warpsplat.drawing.strokes.ink import find_ink

BLOB = '<circle cx="30" cy="36" r="16" fill="#000"/><path d="M30 36H88"/>'
STAR = '<path d="M30 8l7 21h22l-18 13 7 21-18-13-18 13 7-21L1 29h22z" fill="#000" stroke="none"/>'


def test_lines_alone_have_no_areas() -> None:
    ink = find_ink(drawn('<path d="M10 20H86"/><path d="M48 20V62"/>'))
    thin, areas = split_areas(ink)
    assert areas is None
    assert (thin.mask == ink.mask).all()


def test_an_area_and_the_line_that_leaves_it() -> None:
    thin, areas = split_areas(find_ink(drawn(BLOB)))
    assert areas is not None
    assert len(areas) == 1
    assert not (thin.mask & (areas.labels > 0)).any()
    rows, columns = np.nonzero(thin.mask)
    assert columns.min() >= 44
    assert abs(rows.mean() - 35.5) < 0.6
    inner = areas.cover[15:58, 8:40]
    assert abs(inner.sum() + areas.cover[15:58, 40:49].sum() - np.pi * 17.5**2) < 12


def test_a_partly_covered_edge_is_measured_although_ink_is_broad() -> None:
    image = drawn('<path d="M20.25 12H60V60H20.25z" fill="#000" stroke="none"/><path d="M70 5V60"/>')
    _, areas = split_areas(find_ink(image))
    assert areas is not None
    assert np.allclose(areas.cover[20:50, 20], 0.75, atol=0.02)


def test_tips_belong_to_their_area() -> None:
    thin, areas = split_areas(find_ink(drawn(STAR + '<path d="M66 10V60M66 30H90"/>')))
    assert areas is not None
    assert len(areas) == 1
    assert np.nonzero(thin.mask)[1].min() > 60


def test_a_line_reaches_into_its_area() -> None:
    drawing = find_lines(find_ink(drawn(BLOB)), mixed=True)
    assert drawing.areas is not None
    assert len(drawing.lines) == 1
    ends = drawing.lines[0].points[[0, -1]]
    assert drawing.areas.labels[36, int(ends[:, 0].min())] == 1
    assert 84 < ends[:, 0].max() < 90
    assert drawing.area_pens.tolist() == [drawing.lines[0].pen]


def test_pens_have_the_colour_of_their_areas() -> None:
    image = drawn('<circle cx="30" cy="36" r="16" fill="#c00" stroke="none"/><path d="M60 5V60M60 30H90"/>')
    drawing = find_lines(find_ink(image, mixed=True), mixed=True)
    assert np.allclose(drawing.pens[drawing.area_pens[0]], [0.8, 0, 0], atol=0.01)
    assert drawing.lines[0].pen != drawing.area_pens[0]


def test_what_is_beside_an_area_is_no_line() -> None:
    away = np.arange(40.0)[None].repeat(10, axis=0)
    points = np.array([[3.5, 2.5], [4.5, 2.5], [5.5, 2.5]])
    assert is_beside(points, np.full(3, 4.0), away)
    assert not is_beside(points, np.full(3, 3.0), away)


def test_ends_far_from_areas_stay() -> None:
    away = np.arange(40.0)[None].repeat(10, axis=0)
    points = np.stack([np.arange(20.0, 0.0, -1.0) + 0.5, np.full(20, 4.5)], axis=1)
    longer, widths = with_ends_in_areas(points, np.full(20, 3.0), away)
    assert len(longer) == len(widths) == 21
    assert np.allclose(longer[0], points[0])
    assert np.allclose(longer[-1], [1.5 - 4, 4.5])


def test_a_dot_on_a_line() -> None:
    line = '<path d="M8 36H88" stroke-width="1"/>'
    image = drawn(line + '<circle cx="48" cy="36" r="5" fill="#000" stroke="none"/>')
    (dot,), covered = round_dots(find_ink(image), 1.0)
    assert dot.width == pytest.approx(10, abs=0.6)
    assert dot.ends.mean(axis=0) == pytest.approx((48, 36), abs=0.2)
    assert covered[36, 48]
    assert not covered[36, 60]


def test_a_part_of_a_broader_line_is_no_dot() -> None:
    image = drawn('<circle cx="48" cy="36" r="20" stroke-width="2.9"/>')
    dots, covered = round_dots(find_ink(image), 1.0)
    assert not dots
    assert not covered.any()
