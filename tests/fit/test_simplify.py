"""Splines with fewer points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.scenes import canvas, mixed_scene, random_scene
from warpsplat.fit.place import circle_splines
from warpsplat.fit.simplify import MIN_POINTS_BETWEEN, MIN_SPLINE_POINTS, simplify, without
from warpsplat.scene import Basis, FloatArray, Kind, Scene
from warpsplat.scene.geometry import areas, flatten

SUBPIXELS = 16
"""Grid points per unit, for areas by counting."""


def removed(outline: FloatArray, k: int, moved: FloatArray) -> FloatArray:
    """Return a ring or chain without point ``k``, whose neighbours go to ``moved``."""
    points = outline.copy()
    points[[k - 1, (k + 1) % len(outline)]] = moved
    return np.delete(points, k, axis=0)


def between(a: FloatArray, b: FloatArray, kind: Kind = Kind.FILL) -> float:
    """Return the area between two splined outlines, by counting; chains have the same ends."""
    masks = []
    for points in (a, b):
        mask = np.zeros((64 * SUBPIXELS, 64 * SUBPIXELS), np.uint8)
        outline = flatten(points[None], kind == Kind.FILL, Basis.SPLINE, pieces=64)[0]
        if kind == Kind.STROKE:  # closed below the canvas
            outline = np.concatenate([outline, [[outline[-1, 0], 80], [outline[0, 0], 80]]])
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


def chain_of(count: int) -> FloatArray:
    """Return a wavy chain in 64 x 64."""
    x = np.linspace(6, 58, count)
    return np.stack([x, 32 + 14 * np.sin(x / 8)], axis=1).astype(np.float32)


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


def test_area_that_a_stroke_sweeps() -> None:
    """For the points whose neighbours are free to move."""
    chain = chain_of(14)
    moved, area = without(chain[None], closed=False)
    for k in range(3, 11):
        counted = between(chain, removed(chain, k, moved[0, k]), Kind.STROKE)
        assert area[0, k] == pytest.approx(counted, rel=0.12, abs=0.2), k


def test_a_point_of_a_straight_part_costs_nothing() -> None:
    side = np.stack([np.arange(8) * 6.0 + 8, np.full(8, 10.0)], axis=1)
    corner = np.array([[54, 30], [50, 50], [32, 56], [12, 50], [8, 30]], float)
    ring = np.concatenate([side, corner]).astype(np.float32)
    moved, area = without(ring[None], closed=True)
    assert (area[0, 3:5] < 1e-3).all(), "three others on the side before and behind"
    np.testing.assert_allclose(moved[0, 3:5, :, 1], 10, atol=1e-4)
    assert area[0, 8:].min() > 1
    x = np.arange(9, dtype=np.float32) * 6 + 8
    chain = np.stack([x, 0.5 * x + 10], axis=1)
    assert without(chain[None], closed=False)[1][0, 1:-1].max() < 1e-3
    chain[4, 1] += 5
    assert without(chain[None], closed=False)[1][0, 4] > 1


@pytest.mark.parametrize("count", [4, 5, 6, 11])
def test_ends_of_a_stroke_stay(count: int) -> None:
    """Neither removed nor moved, whichever point goes."""
    chain = chain_of(count)
    moved, area = without(chain[None], closed=False)
    assert np.isinf(area[0, [0, -1]]).all()
    assert np.isfinite(area[0, 1:-1]).all()
    for k in range(1, count - 1):
        np.testing.assert_array_equal(removed(chain, k, moved[0, k])[[0, -1]], chain[[0, -1]])


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


def test_the_cheapest_point_goes_first() -> None:
    scene = mixed_scene(64, 48, seed=2).append(random_scene(Kind.FILL, 3, basis=Basis.SPLINE, seed=3))
    thin, keep = simplify(scene, np.ones(len(scene), np.float32), 1)
    costs = []
    for i in np.flatnonzero((scene.basis == Basis.SPLINE) & (scene.point_counts() > MIN_SPLINE_POINTS)):
        moved, area = without(scene.points_of(i)[None], closed=scene.kind[i] == Kind.FILL)
        k = int(area[0].argmin())
        costs.append((area[0, k], scene.first[i] + k, removed(scene.points_of(i), k, moved[0, k]), i))
    _, cheapest, points, owner = min(costs, key=lambda c: c[0])
    assert np.setdiff1d(np.arange(len(scene.points)), keep).tolist() == [cheapest]
    np.testing.assert_array_equal(thin.points_of(owner), points)


def test_shapes_of_great_worth_keep_their_points() -> None:
    scene = random_scene(Kind.FILL, 3, basis=Basis.SPLINE)
    worth = np.float32([1e6, 1, np.inf])
    assert simplify(scene, worth, 3)[0].point_counts().tolist() == [12, 9, 12]
    counts = simplify(scene, worth, 1000)[0].point_counts()
    assert counts[2] == 12
    assert counts[0] < 12


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


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("empty", [False, True])
def test_nothing_to_simplify(kind: Kind, empty: bool) -> None:
    """Cubics, splines of few points and no shapes at all."""
    scene = random_scene(kind, basis=Basis.CUBIC if kind == Kind.FILL else Basis.SPLINE, beziers=2)
    scene = scene.take(np.arange(0)) if empty else scene
    thin, keep = simplify(scene, np.ones(len(scene), np.float32), 10)
    np.testing.assert_array_equal(thin.points, scene.points)
    np.testing.assert_array_equal(keep, np.arange(len(scene.points)))


@pytest.mark.parametrize("count", [4, 6, 12])
def test_circles_of_few_points(count: int) -> None:
    """New shapes are as large as asked for, whatever the number of points."""
    ring = circle_splines(np.array([[32.0, 32.0]]), np.array([20.0]), count)[0]
    assert areas(one(ring))[0] == pytest.approx(np.pi * 400, rel=0.03)
