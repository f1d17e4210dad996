"""Estimated sizes of files against their text."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, GOLD, RED, WHITE, disc, drawing, logo, polygon
from warpsplat.scene import Canvas
from warpsplat.svg.sizes import estimated_size
from warpsplat.svg.write import write_svg


@pytest.mark.parametrize("per_pixel", [1.0, 3.0, 10.0, 50.0])
def test_about_the_bytes_of_a_file(per_pixel: float) -> None:
    """For a picture of lines, arcs and curves, and as many of them as words need."""
    rng = np.random.default_rng(0)
    corners = 200 * rng.random((40, 7, 2))
    outlines = [polygon(*ring.tolist()) for ring in corners]
    many = drawing(Canvas(200, 200, WHITE), *[(color, outlines) for color in (RED, BLUE, GOLD)]).scene
    shaken = logo().scene
    points = shaken.points + rng.normal(0, 0.3, shaken.points.shape).astype(np.float32)
    discs = drawing(Canvas(64, 64, WHITE), (RED, [disc(20, 20, 8)]), (BLUE, [disc(40, 44, 11)])).scene
    for scene in (many, shaken, replace(shaken, points=points), discs):
        assert estimated_size(scene, per_pixel) == pytest.approx(
            len(write_svg(scene, per_pixel=per_pixel)), rel=0.12
        )
