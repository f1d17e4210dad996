"""Losses written in torch, in the fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

import warpsplat
from tests.fit.pictures import picture
from warpsplat import CustomLoss
from warpsplat.errors import UsageError
from warpsplat.fit.custom_loss import evaluate
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import on_white, render_svg

PICTURE = picture(48, 36)
ACROSS = torch.tensor([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], dtype=torch.float32) / 8
SOBEL = torch.stack([ACROSS, ACROSS.T])[:, None]


def edges(image: torch.Tensor) -> torch.Tensor:
    """Differences of a 3x3 Sobel filter, of each channel along both axes."""
    return torch.nn.functional.conv2d(image.permute(2, 0, 1)[:, None], SOBEL)


def sobel(render: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    return (edges(render) - edges(target)).square().mean()


class Darker(torch.nn.Module):
    """A network: a scale of the brightness."""

    def __init__(self) -> None:
        super().__init__()
        self.scale = torch.nn.Parameter(torch.tensor(1.0))

    def forward(self, render: torch.Tensor) -> torch.Tensor:
        return self.scale * render.square().mean(dim=2)


def fitted(loss: Any) -> FloatArray:
    options: dict[str, Any] = {"curves": 10, "iterations": 56, "device": "cpu", "threads": 1}
    result = warpsplat.vectorize(PICTURE, loss=loss, subject="photo", **options)
    return np.asarray(on_white(render_svg(result.svg)) / 255, np.float32)


def test_a_loss_of_edges_falls_further_than_without_it() -> None:
    """Measured on the file."""
    target = torch.tensor(PICTURE)
    losses = (None, CustomLoss(sobel, with_target=True))
    before, after = (float(sobel(torch.tensor(fitted(loss)), target)) for loss in losses)
    assert after < 0.85 * before, "over five seeds 0.50 to 0.68 times"


def test_a_module_is_a_loss() -> None:
    """Its parameters get no gradients."""
    darker = Darker()
    assert fitted(darker).mean() < 0.7 * fitted(None).mean()
    assert darker.scale.grad is None


def test_values_and_gradients_are_those_of_torch() -> None:
    image = np.random.default_rng(0).uniform(size=(9, 7, 3)).astype(np.float32)
    made = CustomLoss(Darker()).on("cpu")
    with torch.no_grad():  # a user's setting
        found = evaluate(made, image)
    assert found.by_pixel is not None and found.by_pixel.shape == (9, 7)
    assert found.value == pytest.approx(float(np.square(image).mean()), rel=1e-5)
    np.testing.assert_allclose(found.gradient, 2 * image / image.size, rtol=1e-5)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda render: render.detach().mean(), "torch sees no path from the render to its value"),
        (lambda render: torch.ones((), requires_grad=True), "torch sees no path"),
        (lambda render: 0.5, "the loss returned 0.5, which is not a tensor"),
        (lambda render: render.mean() / 0, "the loss is inf"),
        (lambda render: (0 * render).sqrt().sum(), "gradient has numbers that are not finite"),
        (lambda render: render.mean(dim=0), r"the loss's value has shape \(7, 3\)"),
        (lambda render: render @ render, "the loss raised RuntimeError"),
    ],
)
def test_a_fault_is_one_clear_line(function: Callable[[torch.Tensor], Any], message: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        evaluate(CustomLoss(function).on("cpu"), np.full((9, 7, 3), 0.5, np.float32))
    assert "\n" not in str(caught.value)


def test_a_loss_is_computed_where_torch_can(monkeypatch: pytest.MonkeyPatch) -> None:
    """A PyTorch without CUDA beside a GPU."""
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    places = list[torch.device]()

    def loss(render: torch.Tensor) -> torch.Tensor:
        places.append(render.device)
        return render.square().mean()

    found = evaluate(CustomLoss(loss, torch=True).on("cuda:0"), PICTURE)
    assert places == [torch.device("cpu")]
    np.testing.assert_allclose(found.value, np.square(PICTURE).mean(), rtol=1e-6)
