"""Outlines as polylines, against de Boor's recursion in float64."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.helpers import outline_of, pieces_of, renderer_for
from tests.reference.curves import bezier, chain, spline_at
from tests.reference.outline import polyline
from tests.scenes import disc, mixed_scene, point_count, random_scene
from warpsplat.fit.place import circle_splines
from warpsplat.kernels import bezier as kernels
from warpsplat.kernels.constants import FLATNESS, FLATNESS_STROKE
from warpsplat.scene import Basis, Kind, Scene

LENGTHS = {Kind.FILL: (3, 4, 5, 12), Kind.STROKE: (1, 2, 3, 9)}
"""Quadratics of splines."""
SPLINES = [(kind, n) for kind in Kind for n in LENGTHS[kind]]


def curve(scene: Scene, shape: int, t: torch.Tensor) -> torch.Tensor:
    """The outline of a shape at t in [0, Béziers]."""
    points = torch.tensor(scene.points_of(shape), dtype=torch.float64)
    kind, basis = Kind(int(scene.kind[shape])), Basis(int(scene.basis[shape]))
    if basis == Basis.SPLINE:
        return spline_at(points, kind == Kind.FILL, t)
    return bezier(chain(points, kind == Kind.FILL, basis), t)


@pytest.mark.parametrize(("kind", "beziers"), SPLINES)
def test_the_reference_agrees_with_the_recursion(kind: Kind, beziers: int) -> None:
    scene = random_scene(kind, 1, basis=Basis.SPLINE, beziers=beziers, seed=beziers)
    t = torch.linspace(0, beziers, 101, dtype=torch.float64)
    points = torch.tensor(scene.points, dtype=torch.float64)
    np.testing.assert_allclose(
        bezier(chain(points, kind == Kind.FILL, Basis.SPLINE), t), curve(scene, 0, t), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_vertices(device: str, scale: float) -> None:
    """Those of all shapes of a mixed scene, and none lies farther from its outline than is allowed."""
    scene = mixed_scene(seed=5)
    renderer = renderer_for(scene, device, scale)
    buffers = outline_of(renderer)
    vertex, firsts, lasts = (x.numpy() for x in (buffers.vertex, buffers.vertex_first, buffers.vertex_last))
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


@pytest.mark.parametrize("basis", Basis)
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


@pytest.mark.parametrize(
    ("kind", "basis", "beziers"),
    [(k, Basis.SPLINE, n) for k, n in SPLINES] + [(Kind.FILL, Basis.CUBIC, 3), (Kind.STROKE, Basis.CUBIC, 3)],
)
def test_weights_of_points(kind: Kind, basis: Basis, beziers: int) -> None:
    """The adjoint's weights are the derivative of the outline by its points."""
    count = point_count(kind, basis, beziers)
    points = torch.zeros((count, 2), dtype=torch.float64, requires_grad=True)
    of_point = range(4 if basis == Basis.CUBIC else 3)
    for local in range(beziers):
        for t in (0.0, 0.25, 1.0):
            at = bezier(
                chain(points, kind == Kind.FILL, basis), torch.tensor([local + t], dtype=torch.float64)
            )
            (want,) = torch.autograd.grad(at[0, 0], points)
            weights = kernels.cubic_weights(t)
            got = np.zeros(count)
            for j in of_point:
                before = local - 1 if kind == Kind.FILL else local
                index = 3 * local + j if basis == Basis.CUBIC else before + j
                got[index % count] += kernels.point_weight(
                    int(kind == Kind.FILL), int(basis), count, local, j, weights
                )
            np.testing.assert_allclose(got, want[:, 0], atol=1e-6)
