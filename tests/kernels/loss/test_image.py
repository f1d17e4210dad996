"""Losses of images, and their gradients, against float64."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import relative_error, run
from tests.reference import losses
from warpsplat.alpha import on, squares, straight
from warpsplat.kernels.loss import image as kernels
from warpsplat.kernels.loss.alpha import make_alpha_loss
from warpsplat.kernels.loss.edges import make_edge_backward, make_edge_slopes
from warpsplat.kernels.loss.window import window_loss
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.tiles import from_tiles, read_tiles, to_tiles
from warpsplat.scene import FloatArray

WIDTH, HEIGHT = 37, 27
SHAPE = (HEIGHT, WIDTH, 3)
TILES_X, TILE_COUNT = 3, 6


class Launched:
    """Gradient and sums of kernels, for an image that ends inside a tile.

    What lies in the padding of the tiles must not count, nor must weights that nobody gave.
    """

    def __init__(
        self,
        kernels: Sequence[wp.Kernel],
        a: FloatArray,
        b: FloatArray,
        backend: Backend,
        *,
        weights: FloatArray | None = None,
        before: float = 5,
        **values: Any,
    ) -> None:
        planes, lanes = a.shape[2], backend.lanes
        is_outside = to_tiles(np.ones_like(a)) == 0
        given = np.full(SHAPE[:2], 7, np.float32) if weights is None else weights
        gradient = backend.columns_of(np.full(is_outside.shape, before, np.float32))
        sums = {
            name: backend.array(float, TILE_COUNT, planes, lanes) for name in ("loss", "similarity", "edges")
        }
        arrays = {
            "image": backend.columns_of(to_tiles(a) + 9 * is_outside.astype(np.float32)),
            "target": backend.columns_of(to_tiles(b)),
            "inside": backend.columns_of(to_tiles(np.ones_like(a))[:, 0]),
            "importance": backend.columns_of(to_tiles(given[..., None])[:, 0]),
            "tile_cache": backend.array(wp.int32, TILE_COUNT),
            "image_grad": gradient,
            **{name: backend.array(backend.column, *gradient.shape) for name in ("across_grad", "down_grad")},
        }
        numbers = {"width": WIDTH, "height": HEIGHT, "tiles_x": TILES_X, "tile_count": TILE_COUNT}
        numbers |= {"value_count": 3 * WIDTH * HEIGHT, "lane_columns": backend.lane_columns}
        for kernel in kernels:
            dim = (TILE_COUNT, lanes) if "alpha" in kernel.key else (TILE_COUNT, planes, lanes)
            run(kernel, dim, str(backend.device), {**arrays, **sums, **numbers, **values})
        tiles = read_tiles(gradient)
        self.gradient, self.padding = from_tiles(tiles, WIDTH, HEIGHT), tiles[is_outside]
        self.loss, self.similarity, self.edges = (
            each.numpy().sum(dtype=np.float64) for each in sums.values()
        )


def image_loss(
    a: FloatArray,
    b: FloatArray,
    backend: Backend,
    weights: FloatArray | None,
    *,
    phase: int = 0,
    similarity_weight: float = 0.0,
) -> Launched:
    clock = wp.array([4 + phase], dtype=int, device=backend.device)
    more = {"clock": clock, "weighted": weights is not None, "similarity_weight": similarity_weight}
    kernel = kernels.image_loss if backend.lanes == 1 else window_loss
    return Launched([kernel], a, b, backend, weights=weights, **more)


@pytest.fixture(params=[1, 64])
def backend(device: str, request: pytest.FixtureRequest) -> Backend:
    return replace(Backend.on(device), lanes=request.param)


def images(seed: int, planes: int = 3) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Image, target, weights of mean 1."""
    rng = np.random.default_rng(seed)
    a, b = (rng.uniform(size=(HEIGHT, WIDTH, planes)).astype(np.float32) for _ in range(2))
    weights = rng.uniform(0.1, 3, SHAPE[:2])
    return a, b, (weights / weights.mean()).astype(np.float32)


@pytest.mark.parametrize("weighted", [False, True])
def test_squared_error(backend: Backend, weighted: bool) -> None:
    a, b, weights = images(3)
    got = image_loss(a, b, backend, weights if weighted else None)
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
    got = image_loss(a, b, backend, given, phase=phase, similarity_weight=0.3)
    plain = image_loss(a, b, backend, given, phase=phase)
    assert got.similarity == pytest.approx(float(total.detach()), abs=2e-7 * a.size), "rounding of the mean"
    assert x.grad is not None
    assert relative_error(got.gradient - plain.gradient, x.grad.numpy()) < 1e-4
    assert not got.padding.any()


def test_weights_of_one_change_nothing(backend: Backend) -> None:
    a, b, weights = images(5)
    plain, ones = (
        image_loss(a, b, backend, given, phase=3, similarity_weight=0.3)
        for given in (None, np.ones_like(weights))
    )
    np.testing.assert_array_equal(plain.gradient, ones.gradient)
    assert (plain.loss, plain.similarity) == (ones.loss, ones.similarity)


def test_loss_and_gradient_on_black_and_on_white(backend: Backend) -> None:
    a, b, weights = images(0, 4)
    got = Launched([make_alpha_loss(backend.column)], a, b, backend, weights=weights)
    u = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    v, w = torch.tensor(b, dtype=torch.float64), torch.tensor(weights, dtype=torch.float64)[..., None]

    def error(paper: float) -> torch.Tensor:
        on_paper = (x[..., :3] + paper * (1 - x[..., 3:]) for x in (u, v))
        return (next(on_paper) - next(on_paper)) ** 2

    both = (error(0) + error(1)) / 2
    (w * both).mean().backward()
    assert u.grad is not None
    np.testing.assert_allclose(got.gradient, u.grad.numpy(), atol=1e-6 * float(u.grad.abs().max()) + 1e-9)
    assert np.isclose(got.loss, both.sum().item(), rtol=1e-5)
    np.testing.assert_allclose(squares(a - b), both.sum(-1).detach(), rtol=1e-5)


def test_pictures_on_paper() -> None:
    color, opacity = np.array([0.2, 0.4, 0.8], np.float32), np.float32(0.5)
    picture = np.array([[[*(color * opacity), opacity], [0, 0, 0, 0]]], np.float32)
    np.testing.assert_allclose(on(picture, 1.0), [[color / 2 + 0.5, [1, 1, 1]]], atol=1e-6)
    np.testing.assert_allclose(straight(picture), [[color, [0, 0, 0]]], atol=1e-6)
    opaque = picture[..., :3]
    assert on(opaque, 0.3) is straight(opaque) is opaque


BEFORE = 2.0**-10
"""Gradient that is there already."""


ACROSS = torch.tensor([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], dtype=torch.float64) / 8


def reference(errors: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
    """The loss of errors (height, width, planes) with weights (height, width), in torch."""
    filters = torch.stack([ACROSS, ACROSS.T])[:, None]
    slopes = torch.nn.functional.conv2d(errors.permute(2, 0, 1)[:, None], filters, padding=1)
    return (weights * slopes**2).sum() / (3 * WIDTH * HEIGHT)


@pytest.mark.parametrize("planes", [3, 4])
def test_edges(backend: Backend, planes: int) -> None:
    """Against torch in float64, and that against central differences."""
    a, b, weights = images(planes, planes)
    both = make_edge_slopes(backend.column), make_edge_backward(backend.column)
    got = Launched(both, a, b, backend, weights=weights, before=BEFORE, edge_weight=0.7)
    x = torch.tensor(a, dtype=torch.float64, requires_grad=True)
    w, y = torch.tensor(weights, dtype=torch.float64), torch.tensor(b, dtype=torch.float64)
    loss = 0.7 * reference(x - y, w)
    loss.backward()
    assert torch.autograd.gradcheck(lambda image: reference(image - y, w), x)
    assert got.edges / (3 * WIDTH * HEIGHT) == pytest.approx(float(loss.detach()), rel=1e-5)
    assert x.grad is not None
    assert relative_error(got.gradient - BEFORE, x.grad.numpy()) < 1e-4, "added to what is there"
    assert (got.padding == BEFORE).all()
