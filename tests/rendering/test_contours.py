"""Shapes of several contours, closed and open, by either rule; fills and strokes of the same points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from tests.helpers import compare, renderer_for
from tests.scenes import contours_scene, random_scene
from warpsplat.fit.optimizer import record_adam
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Kind, Rule

SHAPES = [(Kind.FILL, Rule.NONZERO), (Kind.FILL, Rule.EVENODD), (Kind.STROKE, Rule.NONZERO)]


@pytest.mark.parametrize(("kind", "rule"), SHAPES)
@pytest.mark.parametrize("lanes", [1, 64])
def test_image_and_gradients(device: str, kind: Kind, rule: Rule, lanes: int) -> None:
    compare(contours_scene(kind, rule, seed=3), device, 1.5, lanes=lanes)


def test_the_rules_differ_where_contours_overlap(device: str) -> None:
    images = [renderer_for(contours_scene(Kind.FILL, rule), device).read_image() for rule in Rule]
    assert np.abs(images[0] - images[1]).max() > 0.1


def test_a_fill_closes_its_open_contours(device: str) -> None:
    """As if a straight cubic led back, but for corners, which a ring rounds off by a hundredth of a px."""
    chain = random_scene(Kind.STROKE, 1, seed=4)
    fill = replace(chain, kind=np.zeros(1, np.int32), widths=np.zeros(1, np.float32))
    start, end = chain.points[0], chain.points[-1]
    back = np.stack([end + (start - end) / 3, end + (start - end) * 2 / 3])
    ring = replace(
        fill,
        points=np.concatenate([fill.points, back]),
        first=np.array([0, len(fill.points) + 2], np.int32),
        starts=np.array([0, len(fill.points) + 2], np.int32),
        closed=np.ones(1, np.int32),
    )
    images = [renderer_for(scene, device).read_image() for scene in (fill, ring)]
    np.testing.assert_allclose(images[0], images[1], atol=3e-3)


def test_twins_stay_together(device: str) -> None:
    """A path that is filled and stroked has one outline, which both move."""
    fill = random_scene(Kind.FILL, 2, seed=5)
    stroke = replace(fill, kind=np.ones(2, np.int32), widths=np.full(2, 3, np.float32))
    scene = fill.append(stroke).take(np.array([0, 2, 1, 3]))
    scene = replace(scene, twin=np.array([0, 1, 0, 0], np.int32))
    renderer = renderer_for(scene, device)
    weights = np.random.default_rng(0).normal(size=(36, 40, 3)).astype(np.float32)
    renderer.write_image_grad(weights)
    renderer.backward()
    parameters = renderer.parameters
    before = parameters.gradients()["points"].reshape(4, -1)
    settings = make_settings(iterations=9)
    program = renderer.backend.program()
    clock = renderer.backend.array(wp.int32, 1)
    record_adam(program, parameters, clock, settings)
    program.run()
    after = parameters.gradients()["points"].reshape(4, -1)
    np.testing.assert_allclose(after[0], before[0] + before[1], atol=1e-6)
    np.testing.assert_array_equal(after[1], after[0])
    np.testing.assert_array_equal(after[2:], before[2:])
    moved = parameters.scene()
    np.testing.assert_array_equal(moved.points_of(0), moved.points_of(1))
    assert np.abs(moved.points_of(2) - moved.points_of(3)).max() > 0
