from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import random_scene
from warpsplat.config import Density, make_settings
from warpsplat.density import curves_at, densify, duplicates, least_seen, opacity_threshold, prune_mask
from warpsplat.initialize import circle_outlines, empty_scene, grid_scene
from warpsplat.scene import Kind, Scene

DENSITY = Density()


def circles(centres: list[tuple[float, float]], radii: list[float]) -> Scene:
    scene = random_scene("closed", count=len(centres), width=200, height=200)
    return replace(
        scene,
        points=circle_outlines(np.array(centres), np.array(radii), 2),
        opacities=np.full((len(centres), 1), 0.9, np.float32),
    )


def test_threshold_falls() -> None:
    values = [opacity_threshold(DENSITY, t) for t in (0, 0.3, DENSITY.stop, 1)]
    assert values[0] == DENSITY.opacity_start
    assert values[0] > values[1] > values[2]
    assert values[2] == values[3] == pytest.approx(DENSITY.opacity_end)


def test_faint_curves_go_sooner_early_on() -> None:
    scene = circles([(40, 40), (140, 140)], [20, 20])
    scene.opacities[:, 0] = [0.1, 0.9]
    assert prune_mask(scene, DENSITY, 0.0).tolist() == [True, False]
    assert prune_mask(scene, DENSITY, 0.75).tolist() == [False, False]


def test_tiny_curves_go() -> None:
    scene = circles([(40, 40), (140, 140)], [0.5, 20])
    assert prune_mask(scene, DENSITY, 0.5).tolist() == [True, False]


def test_broken_curves_go() -> None:
    scene = circles([(40, 40), (140, 140)], [20, 20])
    scene.points[0, 3] = np.nan
    assert prune_mask(scene, DENSITY, 0.5).tolist() == [True, False]


def test_duplicates_of_similar_colour_go_one_of_two() -> None:
    scene = circles([(60, 60), (60.5, 60), (60, 60), (140, 140)], [20, 20, 20, 20])
    scene.colors[:] = [[0.5, 0.5, 0.5], [0.51, 0.5, 0.5], [0.9, 0.5, 0.5], [0.5, 0.5, 0.5]]
    assert duplicates(scene, DENSITY).tolist() == [True, False, False, False]


def test_duplicates_match_brute_force() -> None:
    rng = np.random.default_rng(1)
    scene = circles([tuple(x) for x in rng.uniform(50, 60, (60, 2))], list(rng.uniform(18, 22, 60)))
    scene.colors[:] = 0.5 + 0.01 * rng.normal(size=scene.colors.shape)
    boxes = scene.bounds()
    wanted = np.zeros(60, bool)
    for i in range(60):
        for j in range(i):
            low, high = np.maximum(boxes[i, :2], boxes[j, :2]), np.minimum(boxes[i, 2:], boxes[j, 2:])
            common = np.prod(np.clip(high - low, 0, None))
            union = np.prod(boxes[i, 2:] - boxes[i, :2]) + np.prod(boxes[j, 2:] - boxes[j, :2]) - common
            if common / union > 0.9 and np.linalg.norm(scene.colors[i] - scene.colors[j]) < 0.03:
                wanted[min(i, j)] = True
    assert wanted.any()
    np.testing.assert_array_equal(duplicates(scene, DENSITY), wanted)


def test_strokes_with_a_faint_middle_go() -> None:
    scene = random_scene("open", count=3, width=200, height=200, opacity_count=3)
    scene.opacities[:] = [[0.9, 0.2, 0.9], [0.9, 0.6, 0.9], [0.9, 0.2, 0.3]]
    assert prune_mask(scene, DENSITY, 0.5).tolist() == [True, False, False]


def test_least_seen_takes_the_doomed_first() -> None:
    seen = np.array([5, 1, 3, 2, 4], np.float32)
    doomed = np.array([True, False, False, False, True])
    assert set(least_seen(doomed, 3, seen)) == {0, 4, 1}
    assert set(least_seen(doomed, 0, seen)) == {0, 4}


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_new_curves_come_where_the_error_is(kind: Kind) -> None:
    target = np.full((60, 80, 3), 0.5, np.float32)
    image = target.copy()
    target[10:22, 50:62] = [1.0, 0.0, 0.0]
    settings = make_settings(kind=kind)
    scene = replace(empty_scene(settings, target), width=160, height=120)
    added = densify(settings, scene, target, image, 1, np.random.default_rng(0))
    assert len(added) == 1
    np.testing.assert_allclose(added.points[0].mean(axis=0), [112, 32], atol=5)
    assert 200 < added.areas()[0] < 1000, "the square has 24 x 24 canvas units"
    np.testing.assert_allclose(added.colors[0], [1, 0, 0], atol=0.05)


def test_densify_always_gives_the_count_asked_for() -> None:
    settings = make_settings()
    flat = np.full((40, 40, 3), 0.3, np.float32)
    scene = empty_scene(settings, flat)
    for image in (flat, flat + np.float32(0.1)):
        assert len(densify(settings, scene, flat, image, 7, np.random.default_rng(0))) == 7


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("count", [1, 7, 50])
def test_first_curves_cover_the_canvas(kind: Kind, count: int) -> None:
    target = np.random.default_rng(0).uniform(size=(40, 70, 3)).astype(np.float32)
    scene = grid_scene(make_settings(kind=kind), target, count, np.random.default_rng(0))
    assert len(scene) == count
    assert 0.8 < scene.areas().sum() / (40 * 70) < 1.8
    assert np.isfinite(scene.points).all()


def test_the_number_of_curves_grows_to_all() -> None:
    settings = make_settings(curves=90, iterations=1000)
    counts = [curves_at(settings, step) for step in range(0, 1000, 25)]
    assert counts[0] == 30
    assert counts == sorted(counts)
    assert counts[19] < 90
    assert set(counts[20:]) == {90}


@pytest.mark.parametrize("iterations", [1, 30, 60, 100])
def test_short_runs_have_all_curves_at_the_last_turn(iterations: int) -> None:
    settings = make_settings(curves=90, iterations=iterations)
    turns = [s for s in range(25, iterations + 1, 25) if s < settings.density.stop * iterations]
    assert curves_at(settings, turns[-1] if turns else 0) == 90
