from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import relative_error, run
from tests.reference import losses
from warpsplat.kernels.loss import image as kernels
from warpsplat.kernels.loss.window import window_loss
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.tiles import from_tiles, read_tiles, to_tiles
from warpsplat.scene import FloatArray

WIDTH, HEIGHT = 37, 27
SHAPE = (HEIGHT, WIDTH, 3)
TILES_X, TILE_COUNT = 3, 6


class Launched:
    """Gradient and sums of the kernel, for an image that ends inside a tile."""

    def __init__(
        self,
        a: FloatArray,
        b: FloatArray,
        backend: Backend,
        *,
        phase: int = 0,
        similarity_weight: float = 0.0,
        weights: FloatArray | None = None,
    ) -> None:
        outside = 9 * (to_tiles(np.ones_like(a)) == 0).astype(np.float32)
        # What lies in the padding of the tiles must not count.
        # Nor must weights that nobody gave.
        given = np.full(SHAPE[:2], 7, np.float32) if weights is None else weights
        values: dict[str, Any] = {
            "image": backend.columns_of(to_tiles(a) + outside),
            "target": backend.columns_of(to_tiles(b)),
            "importance": backend.columns_of(to_tiles(given[..., None])[:, 0]),
            "weighted": weights is not None,
            "tile_cache": wp.zeros(TILE_COUNT, dtype=int, device=backend.device),
            "width": WIDTH,
            "height": HEIGHT,
            "tiles_x": TILES_X,
            "clock": wp.array([4 + phase], dtype=int, device=backend.device),
            "similarity_weight": similarity_weight,
            "value_count": a.size,
            "image_grad": backend.columns_of(np.full_like(outside, 5)),
            "loss": wp.zeros((TILE_COUNT, 3, backend.lanes), dtype=float, device=backend.device),
            "similarity": wp.zeros((TILE_COUNT, 3, backend.lanes), dtype=float, device=backend.device),
        }
        kernel = kernels.image_loss if backend.lanes == 1 else window_loss
        run(kernel, (TILE_COUNT, 3, backend.lanes), str(backend.device), values)
        tiles = read_tiles(values["image_grad"])
        self.gradient = from_tiles(tiles, WIDTH, HEIGHT)
        self.padding = tiles[to_tiles(np.ones_like(a)) == 0]
        sums = (values[name].numpy().sum(dtype=np.float64) for name in ("loss", "similarity"))
        self.loss, self.similarity = sums


@pytest.fixture(params=[1, 64])
def backend(device: str, request: pytest.FixtureRequest) -> Backend:
    return replace(Backend.on(device), lanes=request.param)


def images(seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Image, target, weights of mean 1."""
    rng = np.random.default_rng(seed)
    a, b = (rng.uniform(size=SHAPE).astype(np.float32) for _ in range(2))
    weights = rng.uniform(0.1, 3, SHAPE[:2])
    return a, b, (weights / weights.mean()).astype(np.float32)


@pytest.mark.parametrize("weighted", [False, True])
def test_squared_error(backend: Backend, weighted: bool) -> None:
    a, b, weights = images(3)
    got = Launched(a, b, backend, weights=weights if weighted else None)
    x = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    squares = (x - torch.tensor(b, dtype=torch.float64)) ** 2
    w = torch.tensor(weights if weighted else np.ones_like(weights), dtype=torch.float64)[..., None]
    (w * squares).mean().backward()
    assert got.loss / a.size == pytest.approx(float(squares.detach().mean()), rel=1e-6), "never weighted"
    assert x.grad is not None
    np.testing.assert_allclose(got.gradient, x.grad.numpy(), rtol=1e-5, atol=1e-9)
    assert not got.padding.any()


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("phase", [0, 1, 2, 3])
def test_ssim(backend: Backend, phase: int, weighted: bool) -> None:
    """Window by window."""
    a, b, weights = images(phase)
    x = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    y = torch.tensor(b, dtype=torch.float64)
    w = torch.tensor(weights if weighted else np.ones_like(weights), dtype=torch.float64)
    borders = [[0, 8, 16, 24, 32, 40], [0, 4, 12, 16, 20, 28, 32, 36, 44]]
    columns, rows = borders[phase % 2], borders[phase // 2]
    total = torch.zeros((), dtype=torch.float64)
    for x0, x1 in itertools.pairwise(columns):
        for y0, y1 in itertools.pairwise(rows):
            u, v = x[y0:y1, x0:x1].reshape(-1, 3), y[y0:y1, x0:x1].reshape(-1, 3)
            if len(u):
                total = total + w[y0:y1, x0:x1].sum() * losses.ssim(u, v).sum()
    (-0.3 * total / a.size).backward()
    given = weights if weighted else None
    got = Launched(a, b, backend, phase=phase, similarity_weight=0.3, weights=given)
    plain = Launched(a, b, backend, phase=phase, weights=given)
    assert got.similarity == pytest.approx(float(total.detach()), abs=2e-7 * a.size), "rounding of the mean"
    assert x.grad is not None
    assert relative_error(got.gradient - plain.gradient, x.grad.numpy()) < 1e-4
    assert not got.padding.any()


def test_weights_of_one_change_nothing(backend: Backend) -> None:
    a, b, weights = images(5)
    plain = Launched(a, b, backend, phase=3, similarity_weight=0.3)
    ones = Launched(a, b, backend, phase=3, similarity_weight=0.3, weights=np.ones_like(weights))
    np.testing.assert_array_equal(plain.gradient, ones.gradient)
    assert (plain.loss, plain.similarity) == (ones.loss, ones.similarity)
