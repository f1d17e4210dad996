"""Tracking of shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.scenes import mixed_scene
from warpsplat.motion.follow import track_shapes
from warpsplat.scene import Scene


def later(scene: Scene, keep: list[int], new: Scene) -> Scene:
    """Return the scene a densification and some steps later."""
    moved = scene.take(np.array(keep))
    points = moved.points + np.random.default_rng(0).normal(0, 0.3, moved.points.shape).astype(np.float32)
    return replace(moved, points=points).append(new)


def test_shapes_are_tracked_through_densification() -> None:
    """Moved shapes keep their numbers, new ones get new numbers, and one order fits all scenes."""
    first, other = mixed_scene(seed=1), mixed_scene(seed=2)
    count = len(first)
    second = later(first, [i for i in range(count) if i != 2], other.take(np.array([0])))
    third = later(second, list(range(1, count)), other.take(np.array([3])))
    numbers, order = track_shapes([first, second, third])
    assert numbers[1].tolist() == [0, 1, *range(3, count), count]
    assert numbers[2].tolist() == [1, *range(3, count), count, count + 1]
    assert sorted(order) == list(range(count + 2))
    assert all((np.diff([order.index(n) for n in row]) > 0).all() for row in numbers)


def test_a_shape_that_changes_depth_is_another_one() -> None:
    """Otherwise no order would fit both scenes."""
    scene = mixed_scene()
    numbers, order = track_shapes([scene, scene.take(np.roll(np.arange(len(scene)), 1))])
    assert numbers[1].tolist() == [len(scene), *range(len(scene) - 1)]
    assert order[0] == len(scene)


def test_scenes_may_be_empty() -> None:
    scene = mixed_scene()
    empty = scene.take(np.arange(0))
    numbers, order = track_shapes([empty, scene, empty, scene])
    assert [len(row) for row in numbers] == [0, len(scene), 0, len(scene)]
    assert sorted(order) == list(range(2 * len(scene)))
