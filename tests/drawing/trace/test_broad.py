"""Areas and dots told apart from lines."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.trace.line_art import drawn
from warpsplat.drawing.strokes.broad import split
from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import trace_ink

STAR = '<path d="M30 8l7 21h22l-18 13 7 21-18-13-18 13 7-21L1 29h22z" fill="#000" stroke="none"/>'


def test_a_partly_covered_edge_is_measured_although_ink_is_broad() -> None:
    image = drawn('<path d="M20.25 12H60V60H20.25z" fill="#000" stroke="none"/><path d="M70 5V60"/>')
    areas = split(find_ink(image), mixed=True).areas
    assert areas is not None
    assert np.allclose(areas.cover[20:50, 20], 0.75, atol=0.02)


def test_tips_belong_to_their_area() -> None:
    parts = split(find_ink(drawn(STAR + '<path d="M66 10V60M66 30H90"/>')), mixed=True)
    thin, areas = parts.thin, parts.areas
    assert areas is not None
    assert areas.labels.max() == 1
    assert np.nonzero(thin.mask)[1].min() > 60


def test_pens_have_the_colour_of_their_areas() -> None:
    image = drawn('<circle cx="30" cy="36" r="16" fill="#c00" stroke="none"/><path d="M60 5V60M60 30H90"/>')
    drawing = trace_ink(find_ink(image, mixed=True), mixed=True)
    assert np.allclose(drawing.pens[drawing.area_pens[0]], [0.8, 0, 0], atol=0.01)
    assert drawing.lines[0].pen != drawing.area_pens[0]


def test_ends_far_from_areas_stay() -> None:
    """A line reaches beyond its own width into the area at one of its ends."""
    image = drawn('<path d="M4 16H36V56H4Z" fill="#000" stroke="none"/><path d="M30 36H80"/>')
    (line,) = trace_ink(find_ink(image, mixed=True), mixed=True).lines
    near, far = sorted(line.points[[0, -1], 0].tolist())
    assert 30 < near < 35
    assert far == pytest.approx(80, abs=1.2)


@pytest.mark.parametrize("paths", ["", '<path d="M8 36H88" stroke-width="1"/>'])
def test_a_dot_beside_lines_and_on_one(paths: str) -> None:
    disc = '<circle cx="48.3" cy="36.4" r="5" fill="#000" stroke="none"/>'
    image = drawn(paths + '<path d="M8 10H88M8 62H88" stroke-width="1"/>' + disc)
    parts = split(find_ink(image), mixed=False)
    (dot,) = parts.dots
    assert not parts.rings
    assert dot.width == pytest.approx(10, abs=0.3)
    assert dot.place == pytest.approx((48.3, 36.4), abs=0.1)
    assert parts.apart is not None
    assert parts.apart[36, 48]
    assert not parts.apart[36, 60]


def test_a_square_is_no_dot() -> None:
    lines = '<path d="M8 10H88M8 62H88" stroke-width="1"/>'
    image = drawn(lines + '<path d="M42 30H54V42H42Z" fill="#000" stroke="none"/>')
    parts = split(find_ink(image), mixed=False)
    assert parts.rings
    assert not parts.dots


def test_a_broader_line_is_no_dot() -> None:
    parts = split(find_ink(drawn('<circle cx="48" cy="36" r="20" stroke-width="2.9"/>')), mixed=False)
    assert not parts.dots
    assert not parts.rings
