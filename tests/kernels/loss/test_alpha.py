"""The loss of a picture with opacity, and its gradient."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import run
from warpsplat.alpha import on, squares, straight
from warpsplat.kernels.loss.alpha import make_alpha_loss
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.tiles import from_tiles, to_tiles


@pytest.mark.parametrize("lanes", [1, 64])
def test_loss_and_gradient_on_black_and_on_white(device: str, lanes: int) -> None:
    backend = replace(Backend.on(device), lanes=lanes)
    rng = np.random.default_rng(0)
    height, width = 20, 37
    image, target = rng.uniform(0, 1, (2, height, width, 4)).astype(np.float32)
    weights = rng.uniform(0.5, 2, (height, width, 1)).astype(np.float32)
    arrays = {
        name: backend.columns_of(to_tiles(value))
        for name, value in (("image", image), ("target", target), ("image_grad", 0 * image))
    }
    arrays["importance"] = backend.columns_of(to_tiles(weights)[:, 0])
    tiles = arrays["image"].shape[0]
    arrays["tile_cache"] = wp.zeros(tiles, dtype=int, device=device)
    arrays["loss"] = wp.zeros((tiles, 3, lanes), dtype=float, device=device)
    numbers = {"lane_columns": backend.lane_columns, "value_count": 3 * height * width}
    run(make_alpha_loss(backend.column), (tiles, lanes), device, arrays, numbers)

    u = torch.tensor(image, dtype=torch.float64, requires_grad=True)
    v, w = (torch.tensor(x, dtype=torch.float64) for x in (target, weights))

    def error(paper: float) -> torch.Tensor:
        a, b = (x[..., :3] + paper * (1 - x[..., 3:]) for x in (u, v))
        return (a - b) ** 2

    both = (error(0) + error(1)) / 2
    (w * both).mean().backward()
    assert u.grad is not None
    got = from_tiles(arrays["image_grad"].numpy(), width, height)
    np.testing.assert_allclose(got, u.grad.numpy(), atol=1e-6 * float(u.grad.abs().max()) + 1e-9)
    assert np.isclose(arrays["loss"].numpy().sum(), both.sum().item(), rtol=1e-5)
    np.testing.assert_allclose(squares(image - target), both.sum(-1).detach(), rtol=1e-5)


def test_pictures_on_paper() -> None:
    color, opacity = np.array([0.2, 0.4, 0.8], np.float32), np.float32(0.5)
    picture = np.array([[[*(color * opacity), opacity], [0, 0, 0, 0]]], np.float32)
    np.testing.assert_allclose(on(picture, 1.0), [[color / 2 + 0.5, [1, 1, 1]]], atol=1e-6)
    np.testing.assert_allclose(straight(picture), [[color, [0, 0, 0]]], atol=1e-6)
    opaque = picture[..., :3]
    assert on(opaque, 0.3) is straight(opaque) is opaque
