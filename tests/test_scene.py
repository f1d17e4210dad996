from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from tests.scenes import disc, random_scene
from warpsplat.parameters import NAMES, Parameters
from warpsplat.scene import Kind


def test_area_and_bounds_of_a_disc() -> None:
    scene = disc(10, 30, 15)
    assert scene.areas()[0] == pytest.approx(np.pi * 100, rel=0.01)
    np.testing.assert_allclose(scene.bounds()[0], [5, 5, 25, 25], atol=0.1)


def test_area_of_a_stroke_is_length_times_width() -> None:
    scene = random_scene("open", count=1)
    line = np.stack([np.linspace(5, 35, 10), np.full(10, 9.0)], axis=1)[None].astype(np.float32)
    straight = replace(scene, points=line, widths=np.array([4.0], np.float32))
    assert straight.areas()[0] == pytest.approx(120, rel=1e-4)
    np.testing.assert_allclose(straight.bounds()[0], [3, 7, 37, 11], atol=1e-4)


def test_arrays_must_fit() -> None:
    scene = random_scene("closed")
    with pytest.raises(ValueError, match="control points"):
        replace(scene, points=scene.points[:, :7])
    with pytest.raises(ValueError, match="do not fit"):
        replace(scene, colors=scene.colors[:2])
    with pytest.raises(ValueError, match="opacities"):
        replace(scene, opacities=np.ones((4, 3), np.float32))


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_surgery_carries_moments_and_ages(device: str, kind: Kind) -> None:
    scene, added = random_scene(kind, count=6), random_scene(kind, count=2, seed=1)
    parameters = Parameters(scene, wp.get_device(device))
    rng = np.random.default_rng(0)
    before = {}
    for name in NAMES:
        group = parameters.groups[name]
        before[name] = [rng.normal(size=group.value.shape).astype(np.float32) for _ in range(2)]
        group.moment1.assign(before[name][0])
        group.moment2.assign(before[name][1])
    parameters.ages.assign(np.arange(10, 16, dtype=np.int32))
    keep = np.array([4, 0, 3, 5])
    parameters.rearrange(keep, added)
    after = parameters.scene()
    assert len(after) == 6
    np.testing.assert_array_equal(after.points, np.concatenate([scene.points[keep], added.points]))
    np.testing.assert_array_equal(after.widths, np.concatenate([scene.widths[keep], added.widths]))
    np.testing.assert_array_equal(parameters.ages.numpy(), [14, 10, 13, 15, 0, 0])
    for name in NAMES:
        group = parameters.groups[name]
        for moment, old in zip((group.moment1, group.moment2), before[name], strict=True):
            np.testing.assert_array_equal(moment.numpy()[:4], old[keep])
            assert not moment.numpy()[4:].any()
