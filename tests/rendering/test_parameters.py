from __future__ import annotations

import numpy as np
import pytest

from tests.scenes import mixed_scene, random_scene
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.scene import ATTRIBUTES, Kind, Scene

SCENES = {
    "fills": (random_scene(Kind.FILL, count=6), random_scene(Kind.FILL, count=2, seed=1)),
    "strokes": (random_scene(Kind.STROKE, count=6), random_scene(Kind.STROKE, count=2, seed=1)),
    "mixed": (mixed_scene(), mixed_scene(seed=1).take(np.arange(2))),
}


@pytest.mark.parametrize(("scene", "added"), SCENES.values(), ids=SCENES.keys())
def test_surgery_carries_moments_and_ages(device: str, scene: Scene, added: Scene) -> None:
    parameters = Parameters(scene, Backend.on(device))
    rng, before = np.random.default_rng(0), {}
    for name, group in parameters.groups.items():
        before[name] = [rng.normal(size=group.value.shape).astype(np.float32) for _ in range(2)]
        group.moment1.assign(before[name][0])
        group.moment2.assign(before[name][1])
    parameters.arrays["ages"].assign(np.arange(10, 10 + parameters.shape_count, dtype=np.int32))
    keep = np.array([4, 0, 3, 5])
    parameters.rearrange(keep, added)
    after, wanted = parameters.scene(), scene.take(keep).append(added)
    for name in ("kind", "basis", "first", *(a.name for a in ATTRIBUTES)):
        np.testing.assert_array_equal(getattr(after, name), getattr(wanted, name))
    np.testing.assert_array_equal(parameters.arrays["ages"].numpy(), [14, 10, 13, 15, 0, 0])
    for attribute in ATTRIBUTES:
        group = parameters.groups[attribute.name]
        rows = scene.rows(attribute, keep)
        for moment, old in zip((group.moment1, group.moment2), before[attribute.name], strict=True):
            np.testing.assert_array_equal(moment.numpy()[: len(rows)], old[rows])
            assert not moment.numpy()[len(rows) :].any()
    assert parameters.revision == 1
