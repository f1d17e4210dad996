"""Grids: positions, scales and angles against the reference; the rules of a grid's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import SPLAT, adjoint, renderer_for
from tests.paper.helpers import grid_of
from tests.scenes import disc, mixed_scene, points_by_shape, random_scene, with_points
from warpsplat.paper import constants as paper
from warpsplat.paper.kernels.strips import row_position
from warpsplat.paper.models import SplatModel
from warpsplat.scene import Kind

SCENES = {
    **{f"fill-{n}": random_scene(Kind.FILL, beziers=n, seed=11) for n in (2, 4, 6)},
    **{f"stroke-{n}": random_scene(Kind.STROKE, beziers=n, seed=11) for n in (1, 2, 3, 4, 5)},
    "mixed": mixed_scene(seed=11, splines=False),
}


def test_rows_crowd_towards_the_boundary() -> None:
    u = np.array([row_position(r, 21, 2.0) for r in range(21)])
    gaps = np.diff(u)
    assert (gaps > 0).all()
    np.testing.assert_allclose(u + u[::-1], 1, atol=1e-6)
    assert (np.diff(gaps[:10]) > 0).all()
    assert u[0] == pytest.approx(0.02275, abs=1e-4)  # Phi(-2)


def test_sample_counts_follow_the_size_in_pixels(device: str) -> None:
    scene = disc(8, 40, 20)
    renderers = [renderer_for(scene, device, s, model=SPLAT) for s in (0.25, 1, 4)]
    counts = [int(r.needed_samples.numpy()[0]) for r in renderers]
    assert counts[0] < counts[1] < counts[2]
    assert counts[2] < 16 * counts[1]
    b = grid_of(renderers[-1])
    mean = b.mean.numpy()[: b.gaussian_last.numpy()[0]]
    # Half way along the chains the strip is about as wide as on average: there the inset is as planned.
    middle = mean[np.abs(mean[:, 0] - 80) < 8]
    inset = 4 * 8 - np.abs(middle[:, 1] - 80).max()
    assert inset == pytest.approx(paper.ROW_INSET, abs=0.3)


@pytest.mark.parametrize("kind", list(Kind))
def test_degenerate_shapes_do_no_harm(device: str, kind: Kind) -> None:
    """All points equal, two ends equal, straight lines: finite image, finite gradients."""
    scene = random_scene(kind, count=3)
    points = points_by_shape(scene)
    points[0] = points[0, 0]
    points[1, 1:4] = points[1, 0]
    points[2, :, 1] = 7.0
    broken = replace(scene, points=with_points(scene, points))
    renderer = renderer_for(broken, device, model=SplatModel(fold=1.0))
    assert np.isfinite(renderer.read_image()).all()
    for name, gradient in adjoint(renderer, np.float32([1, -1, 0.5])).items():
        assert np.isfinite(gradient).all(), name


def test_chain_layout(device: str) -> None:
    """A fill's two chains share both end points: the strip of a thin ellipse is closed at both."""
    ellipse = disc(10, 60, 30)
    points = ellipse.points.copy()
    points[:, 1] = (points[:, 1] - 30) * 0.3 + 30
    b = grid_of(renderer_for(replace(ellipse, points=points), device, model=SPLAT))
    mean = b.mean.numpy()[: b.gaussian_last.numpy()[0]]
    assert mean[:, 0].min() == pytest.approx(20, abs=1.0)
    assert mean[:, 0].max() == pytest.approx(40, abs=1.0)
