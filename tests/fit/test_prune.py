from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import random_scene, with_points
from warpsplat.fit import densification
from warpsplat.fit.densification import PAIRS_PER_CHUNK, duplicates, prune_mask
from warpsplat.fit.place import circle_outlines
from warpsplat.fit.settings import Density
from warpsplat.scene import Kind, Scene
from warpsplat.scene.geometry import bounds

DENSITY = Density()


def circles(centres: list[tuple[float, float]], radii: list[float]) -> Scene:
    scene = random_scene(Kind.FILL, count=len(centres), width=200, height=200)
    return replace(
        scene,
        points=with_points(scene, circle_outlines(np.array(centres), np.array(radii), 2)),
        opacities=np.full(len(centres), 0.9, np.float32),
    )


@pytest.mark.parametrize("progress", [0.0, 0.5, 0.75])
def test_faint_tiny_and_broken_shapes_are_pruned(progress: float) -> None:
    scene = circles([(40 * k, 40) for k in range(1, 5)], [20, 0.5, 20, 20])
    scene.opacities[0] = 0.1
    scene.points[scene.first[2] + 3] = np.nan
    assert prune_mask(scene, DENSITY, progress).tolist() == [progress < 0.7, True, True, False]


@pytest.mark.parametrize("chunk", [7, PAIRS_PER_CHUNK])
def test_duplicates_match_brute_force(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(densification, "PAIRS_PER_CHUNK", chunk)
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
