from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from tests.helpers import relative_error, run
from warpsplat.kernels.loss.edges import make_edge_backward, make_edge_slopes
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.tiles import from_tiles, read_tiles, to_tiles

WIDTH, HEIGHT, TILES_X, TILE_COUNT = 37, 27, 3, 6
BEFORE = 2.0**-10
"""Gradient that is there already."""


ACROSS = torch.tensor([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], dtype=torch.float64) / 8


def reference(errors: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
    """The loss of errors (height, width, planes) with weights (height, width), in torch."""
    filters = torch.stack([ACROSS, ACROSS.T])[:, None]
    slopes = torch.nn.functional.conv2d(errors.permute(2, 0, 1)[:, None], filters, padding=1)
    return (weights * slopes**2).sum() / (3 * WIDTH * HEIGHT)


@pytest.mark.parametrize("lanes", [1, 64])
@pytest.mark.parametrize("planes", [3, 4])
def test_value_and_gradient(device: str, lanes: int, planes: int) -> None:
    """Against torch in float64, on an image that ends inside a tile; that against central differences."""
    backend = replace(Backend.on(device), lanes=lanes)
    rng = np.random.default_rng(planes)
    a, b = (rng.uniform(size=(HEIGHT, WIDTH, planes)).astype(np.float32) for _ in range(2))
    weights = rng.uniform(0.1, 3, (HEIGHT, WIDTH)).astype(np.float32)
    outside = 9 * (to_tiles(np.ones_like(a)) == 0).astype(np.float32)
    gradient = backend.columns_of(np.full_like(outside, BEFORE))
    sums = backend.array(float, TILE_COUNT, planes, lanes)
    values: dict[str, Any] = {
        "lane_columns": backend.lane_columns,
        "image": backend.columns_of(to_tiles(a) + outside),
        "target": backend.columns_of(to_tiles(b)),
        "inside": backend.columns_of(to_tiles(np.ones_like(a))[:, 0]),
        "importance": backend.columns_of(to_tiles(weights[..., None])[:, 0]),
        "tiles_x": TILES_X,
        "tile_count": TILE_COUNT,
        "value_count": 3 * WIDTH * HEIGHT,
        "edge_weight": 0.7,
        "image_grad": gradient,
        "edges": sums,
    }
    slopes = {name: backend.array(backend.column, *gradient.shape) for name in ("across_grad", "down_grad")}
    for kernel in (make_edge_slopes(backend.column), make_edge_backward(backend.column)):
        names = [argument.label for argument in kernel.adj.args[1:]]
        used = {name: value for name, value in {**values, **slopes}.items() if name in names}
        run(kernel, (TILE_COUNT, planes, lanes), str(backend.device), used)
    x = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    w, y = torch.tensor(weights, dtype=torch.float64), torch.tensor(b, dtype=torch.float64)
    loss = 0.7 * reference(x - y, w)
    loss.backward()
    assert torch.autograd.gradcheck(lambda image: reference(image - y, w), x)
    total = sums.numpy().sum(dtype=np.float64) / (3 * WIDTH * HEIGHT)
    assert total == pytest.approx(float(loss.detach()), rel=1e-5)
    assert x.grad is not None
    got = read_tiles(gradient)
    assert relative_error(from_tiles(got, WIDTH, HEIGHT) - BEFORE, x.grad.numpy()) < 1e-4, (
        "added to what is there"
    )
    assert (got[outside > 0] == BEFORE).all()
