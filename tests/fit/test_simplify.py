"""Splines with fewer points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.scenes import canvas, mixed_scene, random_scene
from warpsplat.fit.simplify import MIN_POINTS_BETWEEN, MIN_SPLINE_POINTS, simplify, without
from warpsplat.scene import Basis, FloatArray, Kind, Scene
from warpsplat.scene.geometry import areas, flatten

SUBPIXELS = 16
"""Grid points per unit, for areas by counting."""


def removed(outline: FloatArray, k: int, moved: FloatArray) -> FloatArray:
    """Return a ring without point ``k``, whose neighbours go to ``moved``."""
    points = outline.copy()
    points[[k - 1, (k + 1) % len(outline)]] = moved
    return np.delete(points, k, axis=0)


def between(a: FloatArray, b: FloatArray) -> float:
    """Return the area between two splined rings, by counting."""
    masks = []
    for points in (a, b):
        mask = np.zeros((64 * SUBPIXELS, 64 * SUBPIXELS), np.uint8)
        outline = flatten(points[None], True, Basis.SPLINE, pieces=64)[0]
        cv2.fillPoly(mask, [np.round(outline * SUBPIXELS).astype(np.int32)], 1)
        masks.append(mask)
    return float((masks[0] != masks[1]).sum()) / SUBPIXELS**2


def ring_of(kind: str) -> FloatArray:
    """Return a ring of 14 points in 64 x 64."""
    angle = 2 * np.pi * np.arange(14) / 14
    radius = {
        "circle": 22 + 0 * angle,
        "bean": 20 + 5 * np.cos(2 * angle),
        "wobble": np.random.default_rng(3).uniform(14, 24, 14),
    }[kind]
    return np.asarray(32 + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), np.float32)


def one(ring: FloatArray) -> Scene:
    return Scene.uniform(Kind.FILL, canvas(64, 64), ring[None], Basis.SPLINE)


@pytest.mark.parametrize("kind", ["circle", "bean", "wobble"])
def test_area_and_neighbours_of_a_ring(kind: str) -> None:
    """The area is the counted one; along the bulge that the point made no other move leaves much less."""
    ring = ring_of(kind)
    (moved,), (area,) = without(ring[None], closed=True)
    counted, best = [], 0.0
    for k in range(len(ring)):
        stay = ring[[k - 1, (k + 1) % len(ring)]]
        bulge = ring[k] - stay.mean(axis=0)
        shifts = moved[k] - stay
        np.testing.assert_allclose(shifts[0], shifts[1], atol=1e-4)
        assert abs(shifts[0, 0] * bulge[1] - shifts[0, 1] * bulge[0]) < 1e-3
        counted.append(between(ring, removed(ring, k, moved[k])))
        best += min(between(ring, removed(ring, k, stay + w * bulge)) for w in np.linspace(0, 1, 9))
    np.testing.assert_allclose(area, counted, rtol=0.12)
    assert sum(counted) < 1.05 * best
    if kind == "circle":
        np.testing.assert_allclose(area, area[0], rtol=1e-3)
        assert counted[0] < 0.01 * areas(one(ring))[0]


@pytest.mark.parametrize("count", [0, 1, 5])
def test_as_many_points_as_asked_for_go_and_all_else_stays(count: int) -> None:
    scene = mixed_scene(64, 48, seed=2).append(random_scene(Kind.FILL, 3, basis=Basis.SPLINE, seed=3))
    thin, keep = simplify(scene, np.ones(len(scene), np.float32), count)
    assert len(thin.points) == len(keep) == len(scene.points) - count
    gone = np.setdiff1d(np.arange(len(scene.points)), keep)
    owner = np.repeat(np.arange(len(scene)), scene.point_counts())
    lost = np.bincount(owner[gone], minlength=len(scene))
    np.testing.assert_array_equal(scene.point_counts() - thin.point_counts(), lost)
    assert (scene.basis[lost > 0] == Basis.SPLINE).all()
    for i in np.flatnonzero(lost == 0):
        np.testing.assert_array_equal(thin.points_of(i), scene.points_of(i))
    for name in ("kind", "basis", "colors", "opacities", "widths"):
        np.testing.assert_array_equal(getattr(thin, name), getattr(scene, name))


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("count", range(3, 16))
def test_points_removed_together_are_apart_and_enough_are_left(kind: Kind, count: int) -> None:
    beziers = count if kind == Kind.FILL else count - 2
    scene = random_scene(kind, 5, basis=Basis.SPLINE, beziers=beziers, seed=count)
    thin, keep = simplify(scene, np.ones(5, np.float32), 10_000)
    assert (thin.point_counts() >= min(count, MIN_SPLINE_POINTS)).all()
    if count > MIN_SPLINE_POINTS:
        assert (thin.point_counts() < count).all()
    for i in range(5):
        gone = np.setdiff1d(np.arange(count * i, count * (i + 1)), keep)
        if kind == Kind.STROKE:
            np.testing.assert_array_equal(thin.points_of(i)[[0, -1]], scene.points_of(i)[[0, -1]])
            assert (np.diff(gone) > MIN_POINTS_BETWEEN).all()
        else:
            steps = (gone[:, None] - gone[None, :]) % count
            far = (steps > MIN_POINTS_BETWEEN) & (steps < count - MIN_POINTS_BETWEEN)
            assert ((steps == 0) | far).all()
