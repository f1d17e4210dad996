"""Splines with fewer points."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.scenes import canvas, mixed_scene, random_scene
from warpsplat.fit.densification import densify
from warpsplat.fit.place import circle_splines
from warpsplat.fit.schedule import mean_points_at, phases
from warpsplat.fit.settings import Density, make_settings
from warpsplat.fit.simplify import MIN_POINTS_BETWEEN, MIN_SPLINE_POINTS, simplify, without
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Basis, FloatArray, Kind, Scene
from warpsplat.scene.geometry import areas, flatten

FINE = 16
"""Points of a grid a unit, for areas by counting."""


def removed(ring: FloatArray, k: int, moved: FloatArray) -> FloatArray:
    """A ring or chain without point ``k``, whose neighbours go to ``moved``."""
    points = ring.copy()
    points[[k - 1, (k + 1) % len(ring)]] = moved
    return np.delete(points, k, axis=0)


def between(a: FloatArray, b: FloatArray, kind: Kind = Kind.FILL) -> float:
    """Area between two splined outlines, by counting; chains that start, and end, at the same points."""
    masks = []
    for points in (a, b):
        mask = np.zeros((64 * FINE, 64 * FINE), np.uint8)
        outline = flatten(points[None], kind == Kind.FILL, Basis.SPLINE, pieces=64)[0]
        if kind == Kind.STROKE:  # closed below the canvas
            outline = np.concatenate([outline, [[outline[-1, 0], 80], [outline[0, 0], 80]]])
        cv2.fillPoly(mask, [np.round(outline * FINE).astype(np.int32)], 1)
        masks.append(mask)
    return float((masks[0] != masks[1]).sum()) / FINE**2


def ring_of(kind: str) -> FloatArray:
    """A ring of 14 points in 64 x 64."""
    angle = 2 * np.pi * np.arange(14) / 14
    radius = {
        "circle": 22 + 0 * angle,
        "bean": 20 + 5 * np.cos(2 * angle),
        "wobble": np.random.default_rng(3).uniform(14, 24, 14),
    }[kind]
    return np.asarray(32 + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), np.float32)


@pytest.mark.parametrize("kind", ["circle", "bean", "wobble"])
def test_area_between_the_outlines(kind: str) -> None:
    ring = ring_of(kind)
    moved, area = without(ring[None], closed=True)
    counted = [between(ring, removed(ring, k, moved[0, k])) for k in range(len(ring))]
    np.testing.assert_allclose(area[0], counted, rtol=0.12)


@pytest.mark.parametrize("kind", ["circle", "bean", "wobble"])
def test_neighbours_go_where_little_changes(kind: str) -> None:
    """Along the bulge that the point made, no distance leaves much less area between the outlines."""
    ring = ring_of(kind)
    moved, _ = without(ring[None], closed=True)
    found, best = 0.0, 0.0
    for k in range(len(ring)):
        stay = ring[[k - 1, (k + 1) % len(ring)]]
        bulge = ring[k] - stay.mean(axis=0)
        shifts = moved[0, k] - stay
        np.testing.assert_allclose(shifts[0], shifts[1], atol=1e-4)
        assert abs(shifts[0, 0] * bulge[1] - shifts[0, 1] * bulge[0]) < 1e-3
        found += between(ring, removed(ring, k, moved[0, k]))
        best += min(between(ring, removed(ring, k, stay + w * bulge)) for w in np.linspace(0, 1, 9))
    assert found < 1.05 * best


def test_a_point_of_a_circle_costs_little() -> None:
    ring = ring_of("circle")
    moved, area = without(ring[None], closed=True)
    np.testing.assert_allclose(area[0], area[0, 0], rtol=1e-3)
    assert between(ring, removed(ring, 0, moved[0, 0])) < 0.01 * areas(one(ring))[0]


def test_a_point_of_a_straight_side_costs_nothing() -> None:
    side = np.stack([np.arange(8) * 6.0 + 8, np.full(8, 10.0)], axis=1)
    corner = np.array([[54, 30], [50, 50], [32, 56], [12, 50], [8, 30]], float)
    ring = np.concatenate([side, corner]).astype(np.float32)
    moved, area = without(ring[None], closed=True)
    assert (area[0, 3:5] < 1e-3).all(), "three others on the side before and behind"
    np.testing.assert_allclose(moved[0, 3:5, :, 1], 10, atol=1e-4)
    assert area[0, 8:].min() > 1


def chain_of(count: int) -> FloatArray:
    """A wavy chain in 64 x 64."""
    x = np.linspace(6, 58, count)
    return np.stack([x, 32 + 14 * np.sin(x / 8)], axis=1).astype(np.float32)


@pytest.mark.parametrize("count", [4, 5, 6, 11])
def test_ends_of_a_stroke_stay(count: int) -> None:
    """Neither removed nor moved, whichever point goes."""
    chain = chain_of(count)
    moved, area = without(chain[None], closed=False)
    assert np.isinf(area[0, [0, -1]]).all()
    assert np.isfinite(area[0, 1:-1]).all()
    for k in range(1, count - 1):
        left = removed(chain, k, moved[0, k])
        np.testing.assert_array_equal(left[[0, -1]], chain[[0, -1]])


def test_area_that_a_stroke_sweeps() -> None:
    """Of the points whose neighbours are free to move."""
    chain = chain_of(14)
    moved, area = without(chain[None], closed=False)
    for k in range(3, 11):
        counted = between(chain, removed(chain, k, moved[0, k]), Kind.STROKE)
        assert area[0, k] == pytest.approx(counted, rel=0.12, abs=0.2), k


def test_a_point_of_a_straight_stroke_costs_nothing() -> None:
    x = np.arange(9, dtype=np.float32) * 6 + 8
    chain = np.stack([x, 0.5 * x + 10], axis=1)
    _, area = without(chain[None], closed=False)
    assert area[0, 1:-1].max() < 1e-3
    bent = chain.copy()
    bent[4, 1] += 5
    assert without(bent[None], closed=False)[1][0, 4] > 1


def one(ring: FloatArray) -> Scene:
    return Scene.uniform(Kind.FILL, canvas(64, 64), ring[None], Basis.SPLINE)


def test_the_cheapest_points_go_and_all_else_stays() -> None:
    scene = mixed_scene(64, 48, seed=2).append(random_scene(Kind.FILL, 3, basis=Basis.SPLINE, seed=3))
    worth = np.ones(len(scene), np.float32)
    for count in (0, 1, 5):
        thin, keep = simplify(scene, worth, count)
        gone = np.setdiff1d(np.arange(len(scene.points)), keep)
        assert len(gone) == count
        assert len(thin.points) == len(keep)
        owner = np.repeat(np.arange(len(scene)), scene.point_counts())
        lost = np.bincount(owner[gone], minlength=len(scene))
        np.testing.assert_array_equal(scene.point_counts() - thin.point_counts(), lost)
        for i in range(len(scene)):
            if not lost[i]:
                np.testing.assert_array_equal(thin.points_of(i), scene.points_of(i))
            else:
                assert scene.basis[i] == Basis.SPLINE
        for name in ("kind", "basis", "colors", "opacities", "widths"):
            np.testing.assert_array_equal(getattr(thin, name), getattr(scene, name))
    (index,) = np.setdiff1d(np.arange(len(scene.points)), simplify(scene, worth, 1)[1])
    costs = []
    for i in range(len(scene)):
        kind = Kind(int(scene.kind[i]))
        if scene.basis[i] == Basis.SPLINE and scene.point_counts()[i] > MIN_SPLINE_POINTS:
            moved, area = without(scene.points_of(i)[None], closed=kind == Kind.FILL)
            k = int(area[0].argmin())
            costs.append((area[0, k], scene.first[i] + k, removed(scene.points_of(i), k, moved[0, k]), i))
    _, cheapest, points, owner_of_it = min(costs, key=lambda c: c[0])
    assert index == cheapest
    np.testing.assert_array_equal(simplify(scene, worth, 1)[0].points_of(owner_of_it), points)


def test_what_is_worth_much_keeps_its_points() -> None:
    scene = random_scene(Kind.FILL, 3, basis=Basis.SPLINE)
    thin, _ = simplify(scene, np.float32([1e6, 1, np.inf]), 3)
    assert thin.point_counts().tolist() == [12, 9, 12]
    thin, _ = simplify(scene, np.float32([1e6, 1, np.inf]), 1000)
    assert thin.point_counts()[2] == 12
    assert thin.point_counts()[0] < 12


@pytest.mark.parametrize("count", range(3, 16))
def test_points_removed_at_once_are_apart_and_enough_are_left(count: int) -> None:
    scene = random_scene(Kind.FILL, 5, basis=Basis.SPLINE, beziers=count, seed=count)
    thin, keep = simplify(scene, np.ones(5, np.float32), 10_000)
    assert (thin.point_counts() >= min(count, MIN_SPLINE_POINTS)).all()
    if count > MIN_SPLINE_POINTS:
        assert (thin.point_counts() < count).all()
    for i in range(5):
        gone = np.setdiff1d(np.arange(count * i, count * (i + 1)), keep)
        apart = (gone[:, None] - gone[None, :]) % count
        assert ((apart == 0) | ((apart > MIN_POINTS_BETWEEN) & (apart < count - MIN_POINTS_BETWEEN))).all()


@pytest.mark.parametrize("beziers", range(1, 16))
def test_strokes_lose_points_too(beziers: int) -> None:
    scene = random_scene(Kind.STROKE, 5, basis=Basis.SPLINE, beziers=beziers, seed=beziers)
    count = beziers + 2
    thin, keep = simplify(scene, np.ones(5, np.float32), 10_000)
    assert (thin.point_counts() >= min(count, MIN_SPLINE_POINTS)).all()
    if count > MIN_SPLINE_POINTS:
        assert (thin.point_counts() < count).all()
    for i in range(5):
        np.testing.assert_array_equal(thin.points_of(i)[[0, -1]], scene.points_of(i)[[0, -1]])
        gone = np.setdiff1d(np.arange(count * i, count * (i + 1)), keep)
        assert (np.diff(gone) > MIN_POINTS_BETWEEN).all()


def test_nothing_to_simplify() -> None:
    for scene in (random_scene(Kind.FILL), random_scene(Kind.STROKE, basis=Basis.SPLINE, beziers=2)):
        for some in (scene, scene.take(np.arange(0))):
            thin, keep = simplify(some, np.ones(len(some), np.float32), 10)
            np.testing.assert_array_equal(thin.points, some.points)
            np.testing.assert_array_equal(keep, np.arange(len(some.points)))


def test_turns_of_surgery_follow_the_schedule_of_points(device: str) -> None:
    """From step to step, moments and all; the number of shapes and points is what the schedule says."""
    settings = make_settings(
        curves=12, iterations=60, density=Density(interval=4, stop=1.0, mean_points=8.0, grown=0.1, start=1.0)
    )
    image = picture()
    scene = random_scene(Kind.FILL, 12, 64, 48, basis=Basis.SPLINE)
    state = FitState.start(scene, Backend.on(device), np.random.default_rng(0))
    step = Step(state, settings, Target(image, phases(settings, 64, 48)[-1]))
    while state.step < 56:
        for _ in range(4):
            step.advance()
        step = densify(step, grows=True)
        counts = state.scene().point_counts()
        assert counts.min() >= MIN_SPLINE_POINTS
        # New shapes come with all their points.
        assert counts.mean() < mean_points_at(settings, state.step) + 2
    assert len(counts) == 12
    assert counts.mean() == pytest.approx(8, abs=0.5)
    assert len(set(counts.tolist())) > 1
    step.advance()
    assert np.isfinite(step.psnr())
    same = densify(step, grows=False)
    assert len(same.state.scene()) == 12


def test_circles_of_few_points() -> None:
    """What new shapes are: as large as they are said to be, whatever the number of points."""
    for count in (4, 6, 12):
        ring = circle_splines(np.array([[32.0, 32.0]]), np.array([20.0]), count)[0]
        scene = replace(one(ring), widths=np.zeros(1, np.float32))
        assert areas(scene)[0] == pytest.approx(np.pi * 400, rel=0.03)
