"""Grids: positions, scales and angles against the reference; the rules of a grid's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import SPLAT, adjoint, relative_error, renderer_for
from tests.paper.helpers import grid_of, plans_of
from tests.paper.reference import splat as reference
from tests.paper.reference.grid import grids, runs_of
from tests.reference.curves import tensors
from tests.scenes import disc, mixed_scene, points_by_shape, random_scene, with_points
from warpsplat.paper import constants as paper
from warpsplat.paper.kernels.strips import row_position
from warpsplat.paper.models import SplatModel
from warpsplat.scene import Kind, Scene

SCENES = {
    **{f"fill-{n}": random_scene(Kind.FILL, beziers=n, seed=11) for n in (2, 4, 6)},
    **{f"stroke-{n}": random_scene(Kind.STROKE, beziers=n, seed=11) for n in (1, 2, 3, 4, 5)},
    "mixed": mixed_scene(seed=11, splines=False),
}


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES.keys())
def test_positions_and_conics(device: str, scene: Scene) -> None:
    scale = 0.8
    renderer = renderer_for(scene, device, scale, model=SPLAT)
    b = grid_of(renderer)
    first, last = b.gaussian_first.numpy(), b.gaussian_last.numpy()
    for shape, grid in enumerate(grids(scene, tensors(scene), plans_of(renderer), scale)):
        rows = slice(first[shape], last[shape])
        runs = runs_of(scene, shape)
        mean, scales, angles = (x.detach().numpy() for x in reference.gaussians(grid, runs=runs))
        np.testing.assert_allclose(b.mean.numpy()[rows], mean, atol=1e-4)
        cosine, sine = np.cos(angles), np.sin(angles)
        ix, iy = scales.T**-2.0
        conic = np.stack(
            [cosine**2 * ix + sine**2 * iy, cosine * sine * (ix - iy), sine**2 * ix + cosine**2 * iy], axis=1
        )
        # Where two stations nearly coincide the angle has no meaning in float32.
        worst = np.abs(b.conic.numpy()[rows] - conic).max(axis=1) / conic.max(axis=1)
        assert np.median(worst) < 1e-4
        assert (worst < 1e-2).mean() > 0.95
        assert (b.gaussian_shape.numpy()[rows] == shape).all()


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES.keys())
def test_adjoint_of_positions(device: str, scene: Scene) -> None:
    """The grid stage alone: a random gradient of the means, none of the scales."""
    renderer = renderer_for(scene, device, 1.3, model=SplatModel(through_scales=False))
    b = grid_of(renderer)
    first, last = b.gaussian_first.numpy(), b.gaussian_last.numpy()
    mean_grad = np.random.default_rng(0).normal(size=(renderer.capacity.samples, 2)).astype(np.float32)
    p = tensors(scene)
    total = torch.zeros(())
    for shape, grid in enumerate(grids(scene, p, plans_of(renderer), 1.3)):
        rows = slice(first[shape], last[shape])
        total = total + (torch.tensor(mean_grad[rows]) * grid.reshape(-1, 2)).sum()
    total.backward()
    renderer.backward()
    # The recorded adjoint again, from where the gradients of the means are there.
    b.mean_grad.assign(wp.array(mean_grad, dtype=wp.vec2, device=device))
    launches = renderer.backward_program.launches
    names = [launch.name for launch in launches]
    for launch in launches[names.index("differences_backward") :]:
        for piece in launch.pieces:
            piece()
    got = renderer.parameters.gradients()
    for name in ("points", "widths"):
        gradient = p[name].grad
        want = np.zeros(got[name].shape) if gradient is None else gradient.numpy()
        assert relative_error(got[name], want) < 1e-4, name


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
