"""Outlines, contours and scenes of shapes of different kinds, bases and lengths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import compare, outline_of, pieces_of, renderer_for
from tests.reference.curves import bezier, chain
from tests.reference.outline import polyline
from tests.scenes import CURVES, contours_scene, disc, mixed_scene, random_scene
from warpsplat.fit.optimizer import record_adam
from warpsplat.fit.place import circle_splines
from warpsplat.fit.settings import make_settings
from warpsplat.kernels.constants import FLATNESS, FLATNESS_STROKE
from warpsplat.scene import Basis, Kind, Rule, Scene


def curve(scene: Scene, shape: int, t: torch.Tensor) -> torch.Tensor:
    """The outline of a shape at t in [0, Béziers]."""
    points = torch.tensor(scene.points_of(shape), dtype=torch.float64)
    return bezier(chain(points, scene.kind[shape] == Kind.FILL, Basis(int(scene.basis[shape]))), t)


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_vertices(device: str, scale: float) -> None:
    """Those of all shapes of a mixed scene, and none lies farther from its outline than is allowed."""
    scene = mixed_scene(seed=5)
    renderer = renderer_for(scene, device, scale)
    buffers = outline_of(renderer)
    vertex, (firsts, lasts) = buffers.vertex.numpy(), buffers.vertex_range.numpy().T
    for shape, pieces in enumerate(pieces_of(renderer)):
        kind, basis = Kind(int(scene.kind[shape])), Basis(int(scene.basis[shape]))
        assert min(pieces) >= (3 if basis == Basis.CUBIC else 2)
        points = torch.tensor(scale * scene.points_of(shape), dtype=torch.float64)
        want = polyline(points, pieces, kind == Kind.FILL, basis).numpy()
        got = vertex[firsts[shape] : lasts[shape]]
        np.testing.assert_allclose(got, want[: len(got)], atol=2e-4 * scale)
        steps = np.concatenate([number + np.arange(n) / n for number, n in enumerate(pieces)])
        there = scale * curve(scene, shape, torch.tensor(np.append(steps, len(pieces)))[: len(got)]).numpy()
        worst = np.linalg.norm(got - there, axis=1).max()
        assert 0 < worst <= (FLATNESS if kind == Kind.FILL else FLATNESS_STROKE) * 1.001


@pytest.mark.parametrize("basis", CURVES)
def test_a_polyline_encloses_what_its_curve_does(basis: Basis) -> None:
    """Chords with their ends on the curve lose fifty times as much."""

    def area(vertices: torch.Tensor) -> float:
        a, b = vertices[:-1], vertices[1:]
        return float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2)

    scene = disc(60, 120, 60)
    if basis == Basis.SPLINE:
        ring = circle_splines(np.array([[60.0, 60.0]]), np.array([60.0]), 12)
        scene = Scene.uniform(Kind.FILL, scene.canvas, ring, basis)
    points = torch.tensor(scene.points, dtype=torch.float64)
    count = int(scene.bezier_counts()[0])
    coarse, fine = (polyline(points, [n] * count, True, basis) for n in (3, 300))
    steps = torch.linspace(0, count, 3 * count + 1, dtype=torch.float64)
    chords = curve(scene, 0, steps)
    assert abs(area(coarse) - area(fine)) < 0.02 * abs(area(chords) - area(fine))


SHAPES = [(Kind.FILL, Rule.NONZERO), (Kind.FILL, Rule.EVENODD), (Kind.STROKE, Rule.NONZERO)]


@pytest.mark.parametrize(("kind", "rule"), SHAPES)
@pytest.mark.parametrize("lanes", [1, 64])
def test_image_and_gradients(device: str, kind: Kind, rule: Rule, lanes: int) -> None:
    compare(contours_scene(kind, rule, seed=3), device, 1.5, lanes=lanes)


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


@pytest.mark.parametrize(("seed", "scale"), [(0, 1.0), (2, 1.6)])
def test_exact(device: str, seed: int, scale: float) -> None:
    compare(mixed_scene(seed=seed), device, scale)
