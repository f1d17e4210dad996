"""Which shapes live on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.scenes import mixed_scene
from warpsplat.motion.follow import ascending, lives, nearest
from warpsplat.scene import Scene


def later(scene: Scene, keep: list[int], new: Scene) -> Scene:
    """As a turn of surgery leaves a scene, some steps on."""
    moved = scene.take(np.array(keep))
    rng = np.random.default_rng(0)
    points = moved.points + rng.normal(0, 0.3, moved.points.shape).astype(np.float32)
    return replace(moved, points=points).append(new)


def test_shapes_are_followed_through_surgery() -> None:
    """Those that move keep their numbers; what comes has new ones; all lie in one order."""
    first, other = mixed_scene(seed=1), mixed_scene(seed=2)
    count = len(first)
    second = later(first, [i for i in range(count) if i != 2], other.take(np.array([0])))
    third = later(second, list(range(1, count)), other.take(np.array([3])))
    found = lives([first, second, third])
    assert found.numbers[1].tolist() == [0, 1, *range(3, count), count]
    assert found.numbers[2].tolist() == [1, *range(3, count), count, count + 1]
    place = {number: i for i, number in enumerate(found.order)}
    assert sorted(place) == list(range(count + 2))
    assert all((np.diff([place[n] for n in numbers]) > 0).all() for numbers in found.numbers)


def test_what_changes_its_depth_is_another_shape() -> None:
    """Else it would lie wrong in one of the scenes."""
    scene = mixed_scene()
    turned = scene.take(np.roll(np.arange(len(scene)), 1))
    found = lives([scene, turned])
    assert found.numbers[1].tolist() == [len(scene), *range(len(scene) - 1)]
    assert found.order[0] == len(scene)


def test_scenes_may_be_empty() -> None:
    scene = mixed_scene()
    empty = scene.take(np.arange(0))
    found = lives([empty, scene, empty, scene])
    assert [len(numbers) for numbers in found.numbers] == [0, len(scene), 0, len(scene)]
    assert sorted(found.order) == list(range(2 * len(scene)))


def test_longest_ascending_parts() -> None:
    for values, length in (([], 0), ([3, 1, 2], 2), ([5, 0, 6, 1, 7, 2, 3], 4)):
        found = ascending(values)
        assert len(found) == length and found == sorted(found)
        assert np.all(np.diff([values[i] for i in found]) > 0)


def test_the_nearest_is_the_first_of_several() -> None:
    rows, others = np.zeros((3, 8), np.float32), np.zeros((4, 8), np.float32)
    rows[:, 0], others[:, 0] = [0, 1, 5], [7, 0.25, -0.25, 4]
    assert nearest(rows, others).tolist() == [1, 1, 3]
