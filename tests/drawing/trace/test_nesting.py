"""Translucent bands that lie on one another."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION
from warpsplat.drawing.trace.nesting import find_nesting
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.regions import Regions


def _rings(*opacities: float) -> Regions:
    """Squares inside one another, black, on a clear ground."""
    labels = np.zeros((48, 48), np.int32)
    for number in range(1, len(opacities) + 1):
        labels[4 * number : 48 - 4 * number, 4 * number : 48 - 4 * number] = number
    colorings = [Coloring(np.array([0, 0, 0, opacity]), is_band=True) for opacity in (0.0, *opacities)]
    colorings[0] = Coloring(np.zeros(4))
    fills = np.array([coloring.color for coloring in colorings], np.float32)[labels]
    return Regions(fills, labels, fills, np.arange(len(colorings)), colorings, 0.0)


def test_a_darker_band_lies_on_the_fainter_one_around_it() -> None:
    regions = _rings(20, 80, 140)
    nesting = find_nesting(regions)
    assert nesting.parent.tolist() == [NO_REGION, NO_REGION, 1, 2]
    assert nesting.depth.tolist() == [0, 0, 1, 2]
    assert nesting.shown(0).tolist() == [0, 1, 1, 1]
    assert nesting.shown(1).tolist() == [0, 1, 2, 2]
    through = 1.0
    for region, wanted in ((1, 20), (2, 80), (3, 140)):
        through *= 1 - nesting.colorings[region].color[3] / 255
        assert abs(255 * (1 - through) - wanted) < 0.01
    assert nesting.ordered(np.array([-1, 5, 7, 9])).tolist() == [-1, 0, 1, 2]


def test_a_dark_ring_lies_on_the_fainter_band_inside_it() -> None:
    nesting = find_nesting(_rings(80, 20))
    assert nesting.parent.tolist() == [NO_REGION, 2, NO_REGION]
    assert nesting.colorings[2].color[3] == 20


def test_another_hue_that_nothing_painted_over_gives_lies_beside() -> None:
    regions = _rings(100, 120)
    regions.colorings[1] = Coloring(np.array([100.0, 0, 0, 100]), is_band=True)
    assert find_nesting(regions).depth.max() == 0


def test_nothing_lies_on_a_band_that_is_too_faint_to_be_painted() -> None:
    assert find_nesting(_rings(2, 20, 80)).parent.tolist() == [NO_REGION, NO_REGION, NO_REGION, 2]
