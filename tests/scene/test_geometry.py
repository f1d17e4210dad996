from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import disc, mixed_scene, random_scene
from warpsplat.scene import Kind
from warpsplat.scene.geometry import areas, bounds


@pytest.mark.parametrize("cubics", [3, 4, 7])
def test_area_and_bounds_of_a_disc(cubics: int) -> None:
    scene = disc(10, 30, 15, cubics)
    assert areas(scene)[0] == pytest.approx(np.pi * 100, rel=0.02)
    np.testing.assert_allclose(bounds(scene)[0], [5, 5, 25, 25], atol=0.3)


def test_area_of_a_stroke_is_length_times_width() -> None:
    scene = random_scene(Kind.STROKE, count=1)
    line = np.stack([np.linspace(5, 35, 10), np.full(10, 9.0)], axis=1).astype(np.float32)
    straight = replace(scene, points=line, widths=np.array([4.0], np.float32))
    assert areas(straight)[0] == pytest.approx(120, rel=1e-4)
    np.testing.assert_allclose(bounds(straight)[0], [3, 7, 37, 11], atol=1e-4)


def test_shapes_of_all_lengths_are_measured_in_their_own_rows() -> None:
    scene = mixed_scene(seed=2)
    for i in range(len(scene)):
        one = scene.take(np.array([i]))
        assert areas(scene)[i] > 0
        np.testing.assert_allclose(areas(scene)[i], areas(one)[0], rtol=1e-5)
        np.testing.assert_allclose(bounds(scene)[i], bounds(one)[0], rtol=1e-5)
