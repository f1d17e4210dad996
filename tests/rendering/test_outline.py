"""Outlines as polylines, against float64."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.helpers import outline_of, pieces_of, renderer_for
from tests.reference.curves import bezier, chain
from tests.reference.outline import polyline
from tests.scenes import CURVES, disc, mixed_scene
from warpsplat.fit.place import circle_splines
from warpsplat.kernels.constants import FLATNESS, FLATNESS_STROKE
from warpsplat.scene import Basis, Kind, Scene


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
