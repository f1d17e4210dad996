"""The nearest basic shapes to outlines."""

from __future__ import annotations

import numpy as np
import pytest

from warpsplat.drawing.primitive_fits import (
    FAMILIES,
    OutlinePoints,
    areas,
    distances_and_slopes,
    nearest,
    shape_of,
)

BOX, CIRCLE, ELLIPSE, ROUNDED = FAMILIES
VALUES = {BOX: [30, 20, 12, 8], CIRCLE: [30, 20, 9], ELLIPSE: [30, 20, 12, 6], ROUNDED: [30, 20, 12, 8, 3]}


def points_on(low: np.ndarray, high: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Points around a box with rounded corners."""
    angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if radii[0]:
        return (low + high) / 2 + np.sign(way) * ((high - low) / 2 - radii) + radii * way
    return (low + high) / 2 + (high - low) / 2 * way / np.abs(way).max(axis=1, keepdims=True)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_nearest_shape_is_the_one_that_it_was(family: object) -> None:
    """A tenth of the points may be anywhere: another shape may hide what is there."""
    assert family in VALUES
    wanted = np.array(VALUES[family], float)
    made = shape_of(family, wanted, is_clockwise=True)
    points = points_on(np.array(made.low), np.array(made.high), np.array(made.radii))
    points[:9] += (0, 3)
    fits = nearest(family, OutlinePoints(points[None], np.ones((1, 96))))
    np.testing.assert_allclose(fits.values[0], wanted, atol=0.15)
    assert np.abs(fits.off[0, 9:]).max() < 0.2


def test_distances_and_their_slopes_agree() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-15, 15, (2, 50, 2))
    half, radii = np.array([[12.0, 8], [9, 9]]), np.array([[3.0, 3], [4, 4]])
    here, slopes = distances_and_slopes(points, half, radii)
    moved, _ = distances_and_slopes(points + np.sign(points) * [1e-6, 0], half, radii)
    np.testing.assert_allclose((moved - here)[1] / 1e-6, slopes[0, 1], atol=1e-4)
    wider, _ = distances_and_slopes(points, half + [[1e-6, 0], [0, 0]], radii)
    np.testing.assert_allclose((wider - here)[0] / 1e-6, slopes[2, 0], atol=1e-4)


def test_shapes_have_the_areas_of_their_outlines() -> None:
    assert areas(CIRCLE, np.array([[0.0, 0, 2]])) == pytest.approx(4 * np.pi)
    assert areas(ROUNDED, np.array([[0.0, 0, 3, 2, 1]])) == pytest.approx(24 - 4 + np.pi)
