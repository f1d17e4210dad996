"""Closed contours: their lines, their joints, and shapes of one colour."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.contours import Fill, merged
from warpsplat.drawing.trace.curves import Pieces, straight
from warpsplat.drawing.trace.palette import Coloring


def ring(*corners: tuple[float, float]) -> Pieces:
    ends = np.array(corners, float)
    return Pieces(straight(ends, np.roll(ends, -1, axis=0)), np.ones(len(ends), np.bool_))


def test_shapes_of_one_colour_are_one_unless_something_lies_between() -> None:
    red, blue = Coloring(np.array([255.0, 0, 0, 255])), Coloring(np.array([0, 0, 255.0, 255]))

    def square(coloring: Coloring, x: float) -> Fill:
        return Fill(coloring, [ring((x, 0), (x + 8, 0), (x + 8, 8), (x, 8))])

    apart = merged([square(red, 0), square(blue, 20), square(red, 40)])
    assert [len(fill.contours) for fill in apart] == [2, 1]
    over = merged([square(red, 0), square(blue, 4), square(red, 8)])
    assert [len(fill.contours) for fill in over] == [1, 1, 1]
