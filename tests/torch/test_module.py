"""``warpsplat.torch.Module``, and losses written in torch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

import warpsplat
from tests.fit.pictures import picture
from tests.scenes import random_scene, with_gradients
from tests.svg.foreign import load_scene
from warpsplat import CustomLoss
from warpsplat.errors import UsageError
from warpsplat.fit.custom_loss import evaluate
from warpsplat.fit.settings import make_settings
from warpsplat.scene import FloatArray, Kind, Paint, Scene
from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.torch import Module, SceneTensors, render


def twins() -> Scene:
    """Return a path that is filled and stroked."""
    fill = random_scene(Kind.FILL, 1, seed=1)
    kind, widths = np.array([Kind.STROKE], np.int32), np.full(1, 2, np.float32)
    stroke = replace(fill, kind=kind, widths=widths, colors=1 - fill.colors)
    return replace(fill.append(stroke), twin=np.array([0, 1], np.int32))


def test_rates_are_those_of_a_run() -> None:
    """A canvas of 2000 px is trained at 1265."""
    module = Module(random_scene(Kind.STROKE, 2, 2000, 2000))
    rates = {group["name"]: group["lr"] for group in module.parameter_groups(rate=0.5)}
    assert rates["colors"] == pytest.approx(0.5 * 0.02)
    assert rates["points"] == pytest.approx(0.5 * 3.0 * 2000 / 1265, rel=1e-3)
    assert rates["points"] == pytest.approx(10 * rates["widths"])
    own = {g["name"]: g["lr"] for g in module.parameter_groups(make_settings(rates={"points": 7.0}))}
    assert own["points"] == pytest.approx(7.0 * 2000 / 1265, rel=1e-3)


def test_project_clamps_to_the_bounds() -> None:
    module = Module(random_scene(Kind.STROKE))
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.copy_(torch.where(torch.rand(parameter.shape) < 0.5, -1e6, 1e6))
    module.project()
    found = {name: set(value.flatten().tolist()) for name, value in module.tensors().values.items()}
    assert {round(x, 4) for x in found["opacities"]} <= set(OPACITY_RANGE)
    assert found["colors"] <= {0.0, 1.0} and found["points"] <= {-40.0, 80.0}
    assert found["widths"] <= {1.0, 40.0}


def test_twins_share_their_points_and_add_their_gradients() -> None:
    module, both = Module(twins()), SceneTensors.of(twins(), requires_grad=True)
    optimizer = torch.optim.Adam(module.parameter_groups())
    module().square().sum().backward()
    render(both).square().sum().backward()
    points, gradient = both.values["points"].grad, module.get_parameter("points").grad
    assert points is not None and gradient is not None
    half = len(points) // 2
    torch.testing.assert_close(gradient[:half], points[:half] + points[half:])
    optimizer.step()
    scene = module.scene()
    np.testing.assert_array_equal(scene.points_of(0), scene.points_of(1))
    assert scene.twin.tolist() == [0, 1]
    assert not np.array_equal(scene.points_of(0), twins().points_of(0))


def test_scene_values_are_clamped_to_what_a_file_can_hold() -> None:
    tensors = SceneTensors.of(with_gradients(random_scene(Kind.FILL)))
    for name, value, held in (("opacities", 1.2, 1), ("stop_offsets", -3, 0), ("colors", 2, 1)):
        tensors.values[name].fill_(value)
        assert (getattr(tensors.scene(), name) == held).all()
    assert (tensors.scene().paint[:-1] != Paint.FLAT).all()
    tensors.values["points"][0, 0] = torch.nan
    with pytest.raises(ValueError, match="points: numbers that are not finite"):
        tensors.scene()


def test_a_module_is_saved_and_loaded() -> None:
    first, second = (Module(random_scene(Kind.FILL, 5, 64, 64, seed=seed)) for seed in (1, 2))
    second.load_state_dict(first.state_dict())
    assert torch.equal(first(), second())
    read = load_scene(first.to_svg(), 64, 64, "a file")[0]
    assert (render(SceneTensors.of(read)) - first()).abs().mean() < 2e-3


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


def test_loss_values_and_gradients_match_torch() -> None:
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
