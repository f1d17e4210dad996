"""Blending and its adjoint on coverages of our own; losses; Adam."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests import reference
from tests.kernels.helpers import relative_error, renderer_for
from tests.kernels.test_splat import coverage_images
from tests.scenes import random_scene
from warpsplat.kernels import adam, constants, loss
from warpsplat.kernels.constants import TILE
from warpsplat.kernels.tile import column
from warpsplat.parameters import Parameters
from warpsplat.render import render
from warpsplat.render_exact import ExactRenderer
from warpsplat.scene import Kind
from warpsplat.tiles import from_tiles, to_tiles


@pytest.mark.parametrize("opaque", [False, True])
def test_blending_and_adjoint(device: str, opaque: bool) -> None:
    """Colour and opacity gradients need nothing of the splats: the coverage is taken as given."""
    scene = random_scene("closed", count=8, seed=5)
    if opaque:
        scene.opacities[:] = 0.996
    renderer = renderer_for(scene, device)
    covers = [
        torch.tensor(c[: scene.height, : scene.width].astype(np.float64)) for c in coverage_images(renderer)
    ]
    for c in covers:
        c.requires_grad_()
    p = reference.tensors(scene)
    image = reference.composite(
        covers, p["colors"], p["opacities"], torch.tensor(scene.background.astype(np.float64))
    )
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=2e-4)
    weights = np.random.default_rng(2).normal(size=image.shape)
    (image * torch.tensor(weights)).sum().backward()
    renderer.write_image_grad(weights.astype(np.float32))
    renderer.backward()
    got = renderer.parameters.gradients()
    for name in ("colors", "opacities"):
        gradient = p[name].grad
        assert gradient is not None
        # Behind TRANSMITTANCE_MIN the kernels stop: up to 1e-4 of a weight is missing there.
        assert relative_error(got[name], gradient.numpy()) < (2e-3 if opaque else 2e-5)
    # The gradient of s where the coverage was: d coverage / ds = 1 - coverage.
    parts, tiles = renderer.slot_part.numpy(), renderer.slot_tile.numpy()
    grads = renderer.coverage.numpy()
    for slot in np.flatnonzero((parts >= 0) & (renderer.slot_state.numpy() == constants.PARTIAL)):
        y, x = divmod(int(tiles[slot]), renderer.tiles_x)
        cover = covers[parts[slot]]
        assert cover.grad is not None
        where = (slice(16 * y, 16 * y + 16), slice(16 * x, 16 * x + 16))
        block = (cover.grad * (1 - cover.detach()))[where].numpy()
        mine = grads[slot].reshape(16, 16).T[: block.shape[0], : block.shape[1]]
        # behind / (1 - alpha): what float32 leaves of a difference, magnified 250 times by an opaque shape.
        np.testing.assert_allclose(mine, block, atol=3e-2 if opaque else 2e-4)
        assert np.abs(mine - block).mean() < 1e-4


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_removal_costs_match_brute_force(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=9, seed=3)
    target = np.random.default_rng(0).uniform(size=(scene.height, scene.width, 3)).astype(np.float32)
    renderer = ExactRenderer(Parameters(scene, wp.get_device(device)), scene.width, scene.height, 1.0)
    renderer.forward_complete()
    got = renderer.removal_costs(wp.array(to_tiles(target), dtype=column, device=device))
    whole = np.mean((render(scene, device=device) - target) ** 2)
    for i in range(len(scene)):
        without = render(scene.take(np.delete(np.arange(len(scene)), i)), device=device)
        assert got[i] == pytest.approx(np.mean((without - target) ** 2) - whole, abs=1e-6)


def test_l2(device: str) -> None:
    rng = np.random.default_rng(3)
    a, b = (rng.uniform(size=(13, 21, 3)).astype(np.float32) for _ in range(2))
    image, target = (wp.array(to_tiles(x), dtype=column, device=device) for x in (a, b))
    # What lies in the padding of the tiles must not count.
    image.assign(np.where(to_tiles(np.ones_like(a)) > 0, image.numpy(), 9).astype(np.float32))
    inside = wp.array(to_tiles(np.ones((13, 21, 1), np.float32))[:, 0], dtype=column, device=device)
    grad, sums = wp.zeros_like(image), wp.zeros((2, 1), dtype=float, device=device)
    inputs = [0, TILE, image, target, inside, a.size]
    wp.launch(loss.l2_loss, (2, 1), inputs=inputs, outputs=[grad, sums], device=device)
    x = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    value = torch.nn.functional.mse_loss(x, torch.tensor(b, dtype=torch.float64))
    value.backward()
    assert sums.numpy().sum() / a.size == pytest.approx(float(value.detach()), rel=1e-6)
    assert x.grad is not None
    np.testing.assert_allclose(from_tiles(grad.numpy(), 21, 13), x.grad.numpy(), rtol=1e-5, atol=1e-9)
    assert grad.numpy()[to_tiles(np.ones_like(a)) == 0].max() == 0


@pytest.mark.parametrize("phase", [0, 1, 2, 3])
def test_ssim(device: str, phase: int) -> None:
    """Window by window, over an image that ends inside a tile."""
    rng = np.random.default_rng(phase)
    a, b = (rng.uniform(size=(27, 37, 3)).astype(np.float32) for _ in range(2))
    image, target = (wp.array(to_tiles(x), dtype=column, device=device) for x in (a, b))
    inside = wp.array(to_tiles(np.ones((27, 37, 1), np.float32))[:, 0], dtype=column, device=device)
    clock = wp.array([4 + phase], dtype=int, device=device)
    grad, sums = wp.zeros_like(image), wp.zeros((6, 3), dtype=float, device=device)
    inputs = [0, image, target, inside, clock, 0.3, a.size]
    wp.launch(loss.ssim_backward, (6, 3), inputs=inputs, outputs=[grad, sums], device=device)
    x = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    y = torch.tensor(b, dtype=torch.float64)
    borders = [[0, 8, 16, 24, 32, 40], [0, 4, 12, 16, 20, 28, 32, 36, 44]]
    columns, rows = borders[phase % 2], borders[phase // 2]
    total = torch.zeros((), dtype=torch.float64)
    for x0, x1 in itertools.pairwise(columns):
        for y0, y1 in itertools.pairwise(rows):
            u, v = x[y0:y1, x0:x1].reshape(-1, 3), y[y0:y1, x0:x1].reshape(-1, 3)
            if len(u):
                total = total + len(u) * reference.ssim(u, v).sum()
    (-0.3 * total / a.size).backward()
    assert sums.numpy().sum() == pytest.approx(float(total.detach()), rel=1e-5)
    assert x.grad is not None
    assert relative_error(from_tiles(grad.numpy(), 37, 27), x.grad.numpy()) < 1e-4
    assert not grad.numpy()[to_tiles(np.ones_like(a)) == 0].any()


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_bending(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=6, seed=6)
    points = scene.points.copy()
    points[0] = points[0, 0]
    p = renderer_for(replace(scene, points=points), device).parameters
    p.points_grad.zero_()
    per_curve = wp.zeros(len(scene), dtype=float, device=device)
    inputs = [0, p.points, int(kind == "closed"), 0.7]
    outputs = [p.points_grad, per_curve]
    wp.launch(loss.bending_backward, len(scene), inputs=inputs, outputs=outputs, device=device)
    x = torch.tensor(points, dtype=torch.float64, requires_grad=True)
    chain = torch.cat([x, x[:, :1]], dim=1) if kind == "closed" else x
    p0, p1, p2, p3 = (chain[:, j : j + 3 * (points.shape[1] // 3) : 3] for j in range(4))
    a, b = p0 - 2 * p1 + p2, p1 - 2 * p2 + p3
    chord = ((p3 - p0).square().sum(-1) + 1e-24).sqrt()
    energy = (a.square().sum(-1) + b.square().sum(-1)) / (1 + chord)
    (0.7 * energy.sum()).backward()
    np.testing.assert_allclose(per_curve.numpy(), energy.sum(1).detach().numpy(), rtol=1e-4, atol=1e-9)
    assert x.grad is not None
    assert relative_error(p.gradients()["points"], x.grad.numpy()) < 1e-4


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_xing(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=6, seed=6)
    rng = np.random.default_rng(0)
    scene.points[:] += rng.normal(0, 6, scene.points.shape).astype(np.float32)
    renderer = renderer_for(scene, device)
    p = renderer.parameters
    p.points_grad.zero_()
    per_curve = wp.zeros(len(scene), dtype=float, device=device)
    inputs = [0, p.points, int(kind == "closed"), 0.7]
    wp.launch(
        loss.xing_backward, len(scene), inputs=inputs, outputs=[p.points_grad, per_curve], device=device
    )
    points = torch.tensor(scene.points, dtype=torch.float64, requires_grad=True)
    value = reference.xing(scene, points)
    assert float(value.detach()) > 0.05
    (0.7 * value).backward()
    segments = scene.points.shape[1] // 3
    assert per_curve.numpy().sum() / (len(scene) * segments) == pytest.approx(float(value.detach()), rel=1e-4)
    assert points.grad is not None
    assert relative_error(p.gradients()["points"], points.grad.numpy()) < 1e-4


def test_xing_is_zero_for_a_convex_outline(device: str) -> None:
    from tests.scenes import disc

    scene = disc(10, 30, 15)
    assert float(reference.xing(scene, torch.tensor(scene.points, dtype=torch.float64))) == 0
    p = renderer_for(scene, device).parameters
    p.points_grad.zero_()
    per_curve = wp.zeros(1, dtype=float, device=device)
    wp.launch(
        loss.xing_backward, 1, inputs=[0, p.points, 1, 1.0], outputs=[p.points_grad, per_curve], device=device
    )
    assert per_curve.numpy()[0] == 0
    assert not p.gradients()["points"].any()


def test_adam_matches_torch(device: str) -> None:
    rng = np.random.default_rng(7)
    start = rng.normal(size=(5, 4)).astype(np.float32)
    gradients = rng.normal(size=(20, 5, 4)).astype(np.float32)
    value, grad = (wp.array(start, dtype=float, device=device) for _ in range(2))
    m1, m2 = wp.zeros_like(value), wp.zeros_like(value)
    ages, clock = wp.zeros(5, dtype=int, device=device), wp.zeros(1, dtype=int, device=device)
    x = torch.tensor(start, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.Adam([x], lr=0.1, betas=(0.9, 0.99), eps=1e-12)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda n: 0.1 + 0.9 * 0.5 * (1 + np.cos(np.pi * min((n + 1) / 20, 1)))
    )
    for g in gradients:
        grad.assign(g)
        wp.launch(adam.advance, 5, inputs=[0], outputs=[ages, clock], device=device)
        inputs = [0, grad, ages, clock, 20, 0.1, 0.1, -100.0, 100.0]
        wp.launch(adam.adam_update, (5, 4), inputs=inputs, outputs=[value, m1, m2], device=device)
        x.grad = torch.tensor(g, dtype=torch.float64)
        optimizer.step()
        schedule.step()
    np.testing.assert_allclose(value.numpy(), x.detach().numpy(), rtol=1e-4, atol=1e-4)
    assert clock.numpy()[0] == 20


def test_adam_keeps_bounds_and_ignores_what_is_not_finite(device: str) -> None:
    value = wp.array(np.array([[0.5, 0.5]], np.float32), dtype=float, device=device)
    grad = wp.array(np.array([[-1.0, np.nan]], np.float32), dtype=float, device=device)
    m1, m2 = wp.zeros_like(value), wp.zeros_like(value)
    ages, clock = wp.ones(1, dtype=int, device=device), wp.ones(1, dtype=int, device=device)
    inputs = [0, grad, ages, clock, 10, 5.0, 1.0, 0.0, 1.0]
    wp.launch(adam.adam_update, (1, 2), inputs=inputs, outputs=[value, m1, m2], device=device)
    np.testing.assert_array_equal(value.numpy(), [[1.0, 0.5]])


def test_tiles_and_back() -> None:
    image = np.random.default_rng(0).uniform(size=(37, 50, 3)).astype(np.float32)
    tiles = to_tiles(image)
    assert tiles.shape == (4 * 3, 3, TILE, TILE)
    assert tiles[4 + 1, 2, 5, 3] == image[16 + 3, 16 + 5, 2]
    np.testing.assert_array_equal(from_tiles(tiles, 50, 37), image)
