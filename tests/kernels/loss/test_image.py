from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import relative_error, run
from tests.reference import losses
from warpsplat.kernels.constants import TILE
from warpsplat.kernels.loss import image as kernels
from warpsplat.kernels.tile import column
from warpsplat.render.tiles import from_tiles, to_tiles


@pytest.mark.parametrize("lanes", [1, 16])
def test_l2(device: str, lanes: int) -> None:
    rng = np.random.default_rng(3)
    a, b = (rng.uniform(size=(13, 21, 3)).astype(np.float32) for _ in range(2))
    image, target = (wp.array(to_tiles(x), dtype=column, device=device) for x in (a, b))
    # What lies in the padding of the tiles must not count.
    image.assign(np.where(to_tiles(np.ones_like(a)) > 0, image.numpy(), 9).astype(np.float32))
    inside = wp.array(to_tiles(np.ones((13, 21, 1), np.float32))[:, 0], dtype=column, device=device)
    grad, sums = wp.zeros_like(image), wp.zeros((2, lanes), dtype=float, device=device)
    values = {"image": image, "target": target, "inside": inside, "value_count": a.size, "loss": sums}
    run(kernels.l2_loss, (2, lanes), device, values, lane_columns=TILE // lanes, image_grad=grad)
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
    values = {"image": image, "target": target, "inside": inside, "clock": clock, "value_count": a.size}
    run(kernels.ssim_backward, (6, 3), device, values, weight=0.3, image_grad=grad, similarity=sums)
    x = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    y = torch.tensor(b, dtype=torch.float64)
    borders = [[0, 8, 16, 24, 32, 40], [0, 4, 12, 16, 20, 28, 32, 36, 44]]
    columns, rows = borders[phase % 2], borders[phase // 2]
    total = torch.zeros((), dtype=torch.float64)
    for x0, x1 in itertools.pairwise(columns):
        for y0, y1 in itertools.pairwise(rows):
            u, v = x[y0:y1, x0:x1].reshape(-1, 3), y[y0:y1, x0:x1].reshape(-1, 3)
            if len(u):
                total = total + len(u) * losses.ssim(u, v).sum()
    (-0.3 * total / a.size).backward()
    assert sums.numpy().sum() == pytest.approx(float(total.detach()), rel=1e-5)
    assert x.grad is not None
    assert relative_error(from_tiles(grad.numpy(), 37, 27), x.grad.numpy()) < 1e-4
    assert not grad.numpy()[to_tiles(np.ones_like(a)) == 0].any()
