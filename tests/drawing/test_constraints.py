"""Constraints of a drawing's outlines: points are free numbers' images, and projection keeps them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, RED, WHITE, drawing, logo, outline, polygon, seam
from warpsplat.drawing.constraints import Constraints, Drawing
from warpsplat.scene import Canvas

LEAN = outline(
    (10, 10), ((20, 8), (30, 12), (40, 14)), ((42, 40),), ((30, 41), (20, 42), (11, 40)), ((10, 10),)
)
"""Cubics that lines direct."""

DRAWINGS = pytest.mark.parametrize(
    "made",
    [
        logo(),
        seam(),
        drawing(Canvas(64, 48, WHITE), (RED, [LEAN]), (BLUE, [polygon((0, 0), (9, 0), (5, 9))])),
    ],
    ids=["logo", "seam", "lean"],
)


@DRAWINGS
def test_points_are_projected(made: Drawing) -> None:
    """What keeps the constraints stays; what is projected keeps them."""
    constraints = Constraints(made)
    exact = constraints.project(made.scene.points.astype(float))
    np.testing.assert_allclose(exact, made.scene.points, atol=1e-4)
    moved = constraints.project(exact + np.random.default_rng(1).normal(0, 0.7, exact.shape))
    assert np.abs(moved - exact).max() > 0.5
    np.testing.assert_allclose(constraints.project(moved), moved, atol=1e-9)


@DRAWINGS
def test_free_numbers_move_points_along_the_constraints(made: Drawing) -> None:
    """To first order; and all motions that the projection leaves are theirs."""
    constraints = Constraints(made)
    at = constraints.project(made.scene.points.astype(float))
    freedom = constraints.freedom(at)
    rng = np.random.default_rng(2)
    way = rng.normal(size=freedom.size)
    off = []
    for step in (1e-2, 1e-3):
        moved = at + step * freedom.times(way).reshape(-1, 2)
        off.append(np.abs(constraints.project(moved) - moved).max())
    assert off[1] < 0.02 * off[0] or off[1] < 1e-12
    matrix = np.stack([freedom.times(row) for row in np.eye(freedom.size)], axis=1)
    for _ in range(5):
        shift = 1e-6 * rng.normal(size=at.shape)
        shift[np.minimum(at, np.array([made.scene.canvas.width, made.scene.canvas.height]) - at) < 1e-3] = 0
        change = (constraints.project(at + shift) - at).ravel() / 1e-6
        found = np.linalg.lstsq(matrix, change, rcond=None)[0]
        np.testing.assert_allclose(matrix @ found, change, atol=1e-4)
    ways = rng.normal(size=(2, freedom.size))
    np.testing.assert_allclose(freedom.times(ways[0]) @ ways[1], freedom.adjoint(ways[1]) @ ways[0])


def test_what_is_held_stays() -> None:
    made = logo()
    every = np.arange(len(made.joints))
    held = every % 6 == 0
    constraints = Constraints(made, held)
    at = made.scene.points.astype(float)
    freedom = constraints.freedom(at)
    change = freedom.times(np.random.default_rng(0).normal(size=freedom.size)).reshape(-1, 2)
    assert not change[held].any()
    assert (change[every % 6 == 3] != 0).any(axis=1).all()
