"""Round ink told apart from lines."""

from __future__ import annotations

import pytest

from tests.drawing.trace.line_art import drawn
from warpsplat.drawing.strokes.dots import round_dots
from warpsplat.drawing.strokes.ink import find_ink


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
