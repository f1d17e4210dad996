"""Outlines that are equal stay so on the grid."""

from __future__ import annotations

import numpy as np

from tests.drawing.drawings import RED, WHITE, drawing, star
from warpsplat.drawing.equal import on_grid
from warpsplat.scene import Canvas
from warpsplat.svg.write import rounded


def test_equal_outlines_are_equal_on_the_grid() -> None:
    outlines = [star(x, 20.0, 10, 4) for x in (14.3, 38.64, 63.2)]
    scene = drawing(Canvas(80, 40, WHITE), (RED, outlines)).scene
    equal = [[np.array([0]), np.array([2])]]
    low, held = on_grid(rounded(scene, 3.0), equal, 3.0)
    points = low.points.astype(np.float64).reshape(3, -1, 2)
    apart = points[2] - points[0]
    np.testing.assert_allclose(apart, np.broadcast_to(apart[0], apart.shape), atol=1e-5)
    np.testing.assert_allclose(3 * points[2], np.round(3 * points[2]), atol=0.4)
    assert held.reshape(3, -1).all(axis=1).tolist() == [True, False, True]
