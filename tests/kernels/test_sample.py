"""Sampling: grid positions, scales and angles against the reference; the rules of the grid's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests import reference
from tests.kernels.helpers import plans_of, relative_error, renderer_for
from tests.scenes import disc, random_scene
from warpsplat.kernels import bezier, constants, gaussian
from warpsplat.kernels.sample import row_position
from warpsplat.scene import Kind, Scene

CASES = [("closed", 1, 1), ("closed", 3, 1), ("open", 2, 1), ("open", 2, 3)]


def test_weights() -> None:
    for t in (0.0, 0.3, 1.0):
        weights = bezier.cubic_weights(t)
        tangent = bezier.cubic_tangent_weights(t)
        assert sum(weights) == pytest.approx(1, abs=1e-6)
        assert sum(tangent) == pytest.approx(0, abs=1e-6)
        step = 1e-3
        for j in range(4):
            around = (bezier.cubic_weights(t + step)[j] - bezier.cubic_weights(t - step)[j]) / (2 * step)
            assert tangent[j] == pytest.approx(around, abs=1e-3)


def test_modules_are_installed_under_the_package() -> None:
    assert gaussian.gaussians_forward.module.name == "warpsplat.kernels.gaussian"


@pytest.mark.parametrize(("kind", "chain_cubics", "opacity_count"), CASES)
def test_positions_and_conics(device: str, kind: Kind, chain_cubics: int, opacity_count: int) -> None:
    scene = random_scene(kind, chain_cubics=chain_cubics, opacity_count=opacity_count, seed=11)
    scale = 0.8
    renderer = renderer_for(scene, device, scale)
    first, last = renderer.part_first.numpy(), renderer.part_last.numpy()
    runs = 3 // opacity_count if kind == "open" else 1
    grids = reference.grids(scene, reference.tensors(scene), plans_of(renderer), scale)
    for part, grid in enumerate(grids):
        rows = slice(first[part], last[part])
        mean, scales, angles = (x.detach().numpy() for x in reference.gaussians(grid, runs=runs))
        np.testing.assert_allclose(renderer.mean.numpy()[rows], mean, atol=1e-4)
        cosine, sine = np.cos(angles), np.sin(angles)
        ix, iy = scales.T**-2.0
        conic = np.stack(
            [cosine**2 * ix + sine**2 * iy, cosine * sine * (ix - iy), sine**2 * ix + cosine**2 * iy], axis=1
        )
        # Where two columns nearly coincide the angle has no meaning in float32.
        worst = np.abs(renderer.conic.numpy()[rows] - conic).max(axis=1) / conic.max(axis=1)
        assert np.median(worst) < 1e-4
        assert (worst < 1e-2).mean() > 0.95
        assert (renderer.gaussian_part.numpy()[rows] == part).all()


@pytest.mark.parametrize(("kind", "chain_cubics", "opacity_count"), CASES)
def test_adjoint_of_positions(device: str, kind: Kind, chain_cubics: int, opacity_count: int) -> None:
    """The sampling stage alone: a random gradient of the means, none of the scales."""
    scene = random_scene(kind, chain_cubics=chain_cubics, opacity_count=opacity_count, seed=12)
    renderer = renderer_for(scene, device, 1.3, through_scales=False)
    rng = np.random.default_rng(0)
    mean_grad = rng.normal(size=(renderer.capacity.items, 2)).astype(np.float32)
    p = reference.tensors(scene)
    total = torch.zeros(())
    for part, grid in enumerate(reference.grids(scene, p, plans_of(renderer), 1.3)):
        rows = slice(renderer.part_first.numpy()[part], renderer.part_last.numpy()[part])
        total = total + (torch.tensor(mean_grad[rows]) * grid.reshape(-1, 2)).sum()
    total.backward()
    # Run the recorded adjoint with the splat stage's output replaced.
    assert renderer.backward_program
    launches = renderer.backward_program.launches  # composite, reduce, splat, differences, positions ...
    renderer.backward()
    renderer.mean_grad.assign(wp.array(mean_grad, dtype=wp.vec2, device=device))
    for launch in launches[4:]:
        for piece in launch.pieces:
            piece()
    got = renderer.parameters.gradients()
    assert p["points"].grad is not None
    assert relative_error(got["points"], p["points"].grad.numpy()) < 1e-4
    if kind == "open":
        assert p["widths"].grad is not None
        assert relative_error(got["widths"], p["widths"].grad.numpy()) < 1e-4


def test_rows_crowd_towards_the_boundary() -> None:
    u = np.array([row_position(r, 21, 2.0) for r in range(21)])
    gaps = np.diff(u)
    assert (gaps > 0).all()
    np.testing.assert_allclose(u + u[::-1], 1, atol=1e-6)
    assert (np.diff(gaps[:10]) > 0).all()
    assert u[0] == pytest.approx(0.02275, abs=1e-4)  # Phi(-2)


def test_sample_counts_follow_the_size_in_pixels(device: str) -> None:
    scene = disc(8, 40, 20)
    counts = [int(renderer_for(scene, device, s).needed_items.numpy()[0]) for s in (0.25, 1, 4)]
    assert counts[0] < counts[1] < counts[2]
    assert counts[2] < 16 * counts[1]
    renderer = renderer_for(scene, device, 4)
    mean = renderer.mean.numpy()[: renderer.part_last.numpy()[0]]
    # Half way along the chains the strip is about as wide as on average: there the inset is as planned.
    middle = mean[np.abs(mean[:, 0] - 80) < 8]
    inset = 4 * 8 - np.abs(middle[:, 1] - 80).max()
    assert inset == pytest.approx(constants.ROW_INSET, abs=0.3)


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_degenerate_shapes_do_no_harm(device: str, kind: Kind) -> None:
    """All points equal, two ends equal, straight lines: finite image, finite gradients."""
    scene = random_scene(kind, count=3)
    points = scene.points.copy()
    points[0] = points[0, 0]
    points[1, 1:4] = points[1, 0]
    points[2, :, 1] = 7.0
    renderer = renderer_for(replace(scene, points=points), device, fold=1.0)
    assert np.isfinite(renderer.read_image()).all()
    renderer.write_image_grad(np.broadcast_to(np.float32([1, -1, 0.5]), (renderer.height, renderer.width, 3)))
    renderer.backward()
    for name, gradient in renderer.parameters.gradients().items():
        assert np.isfinite(gradient).all(), name


def test_chain_layout(device: str) -> None:
    """A closed curve's two chains share both end points: the strip of a thin ellipse is closed at both."""
    ellipse = disc(10, 60, 30)
    points = ellipse.points.copy()
    points[..., 1] = (points[..., 1] - 30) * 0.3 + 30
    squeezed: Scene = replace(ellipse, points=points)
    renderer = renderer_for(squeezed, device)
    mean = renderer.mean.numpy()[: renderer.part_last.numpy()[0]]
    assert mean[:, 0].min() == pytest.approx(20, abs=1.0)
    assert mean[:, 0].max() == pytest.approx(40, abs=1.0)
