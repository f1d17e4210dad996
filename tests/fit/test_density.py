from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from warpsplat.fit.density import PAIRS_AT_ONCE, densify, duplicates, least_seen, prune_mask

from tests.fit.pictures import empty_scene
from tests.scenes import mixed_scene, random_scene, with_points
from warpsplat.fit import density
from warpsplat.fit.place import circle_outlines
from warpsplat.fit.settings import Density, make_settings
from warpsplat.portable import filters
from warpsplat.scene import Kind, Scene
from warpsplat.scene.geometry import areas, bounds

DENSITY = Density()


def circles(centres: list[tuple[float, float]], radii: list[float]) -> Scene:
    scene = random_scene(Kind.FILL, count=len(centres), width=200, height=200)
    return replace(
        scene,
        points=with_points(scene, circle_outlines(np.array(centres), np.array(radii), 2)),
        opacities=np.full(len(centres), 0.9, np.float32),
    )


def test_faint_curves_go_sooner_early_on() -> None:
    scene = circles([(40, 40), (140, 140)], [20, 20])
    scene.opacities[:] = [0.1, 0.9]
    assert prune_mask(scene, DENSITY, 0.0).tolist() == [True, False]
    assert prune_mask(scene, DENSITY, 0.75).tolist() == [False, False]


def test_tiny_curves_go() -> None:
    scene = circles([(40, 40), (140, 140)], [0.5, 20])
    assert prune_mask(scene, DENSITY, 0.5).tolist() == [True, False]


def test_broken_curves_go() -> None:
    scene = circles([(40, 40), (140, 140)], [20, 20])
    scene.points[3] = np.nan
    assert prune_mask(scene, DENSITY, 0.5).tolist() == [True, False]


def test_broken_shapes_of_any_length_go() -> None:
    scene = mixed_scene(200, 200, seed=3)
    for shape in (0, 2, len(scene) - 1):
        broken = replace(scene, points=scene.points.copy())
        broken.points[broken.first[shape + 1] - 1, 1] = np.nan
        doomed = prune_mask(broken, replace(DENSITY, area=0.0), 0.5)
        assert np.flatnonzero(doomed).tolist() == [shape]


def test_duplicates_of_similar_colour_go_one_of_two() -> None:
    scene = circles([(60, 60), (60.5, 60), (60, 60), (140, 140)], [20, 20, 20, 20])
    scene.colors[:] = [[0.5, 0.5, 0.5], [0.51, 0.5, 0.5], [0.9, 0.5, 0.5], [0.5, 0.5, 0.5]]
    assert duplicates(scene, DENSITY).tolist() == [True, False, False, False]


@pytest.mark.parametrize("at_once", [7, PAIRS_AT_ONCE])
def test_duplicates_match_brute_force(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(density, "PAIRS_AT_ONCE", at_once)
    rng = np.random.default_rng(1)
    scene = circles([tuple(x) for x in rng.uniform(50, 60, (60, 2))], list(rng.uniform(18, 22, 60)))
    scene.colors[:] = 0.5 + 0.01 * rng.normal(size=scene.colors.shape)
    boxes = bounds(scene)
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


def test_an_empty_scene_has_no_duplicates() -> None:
    assert len(duplicates(empty_scene(make_settings(), np.zeros((8, 8, 3), np.float32)), DENSITY)) == 0


def test_least_seen_takes_the_doomed_first() -> None:
    seen = np.array([5, 1, 3, 2, 4], np.float32)
    doomed = np.array([True, False, False, False, True])
    assert set(least_seen(doomed, 3, seen)) == {0, 4, 1}
    assert set(least_seen(doomed, 0, seen)) == {0, 4}


@pytest.mark.parametrize("kind", list(Kind))
def test_new_curves_come_where_the_error_is(kind: Kind) -> None:
    target = np.full((60, 80, 3), 0.5, np.float32)
    image = target.copy()
    target[10:22, 50:62] = [1.0, 0.0, 0.0]
    settings = make_settings(kind=kind)
    scene = empty_scene(settings, target)
    scene = replace(scene, canvas=replace(scene.canvas, width=160, height=120))
    added = densify(settings, scene, target, image, 1, np.random.default_rng(0))
    assert len(added) == 1
    np.testing.assert_allclose(added.points.mean(axis=0), [112, 32], atol=5)
    assert 200 < areas(added)[0] < 1000, "the square has 24 x 24 canvas units"
    np.testing.assert_allclose(added.colors[0], [1, 0, 0], atol=0.05)


def test_a_candidate_is_the_deepest_pixel_of_its_component() -> None:
    error = filters.gaussian_blur(np.random.default_rng(2).random((40, 60), np.float32), 1.0)
    top = float(np.quantile(error, 0.995))
    wanted = []
    for level in range(1, density.ERROR_LEVELS):
        mask = (error >= top * level / density.ERROR_LEVELS).astype(np.uint8)
        depth = filters.distance(np.pad(mask, 1))[1:-1, 1:-1]
        count, labels = cv2.connectedComponents(mask, connectivity=4)
        for label in range(1, count):
            row, column = np.argwhere((labels == label) & (depth == depth[labels == label].max()))[-1]
            wanted.append((column + 0.5, row + 0.5, depth[row, column], error[labels == label].sum()))
    found = density._candidates(error, mixed=False)
    centres, radii, masses = found.centres, found.radii, found.masses
    assert len(wanted) > 20
    np.testing.assert_array_equal(
        np.column_stack([centres, radii]), np.array(wanted)[:, :3].astype(np.float32)
    )
    assert (masses <= 1.001 * np.array(wanted)[:, 3]).all()


def test_densify_always_gives_the_count_asked_for() -> None:
    settings = make_settings()
    flat = np.full((40, 40, 3), 0.3, np.float32)
    scene = empty_scene(settings, flat)
    for image in (flat, flat + np.float32(0.1)):
        assert len(densify(settings, scene, flat, image, 7, np.random.default_rng(0))) == 7
