"""Losses of images, and their gradients, against float64."""

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
