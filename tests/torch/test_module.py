"""``warpsplat.torch.Module``: rates, bounds, training, what becomes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.scenes import disc, mixed_scene, random_scene, with_gradients
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Kind, Paint, Scene
from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.svg.read import load_scene
from warpsplat.torch import Module, SceneTensors, over, render


def twins() -> Scene:
    """A path that is filled and stroked."""
    fill = random_scene(Kind.FILL, 1, seed=1)
    stroke = replace(
        fill, kind=np.array([Kind.STROKE], np.int32), widths=np.full(1, 2, np.float32), colors=1 - fill.colors
    )
    return replace(fill.append(stroke), twin=np.array([0, 1], np.int32))


def test_parameters_are_what_some_shape_has() -> None:
    names = {name for name, _ in Module(random_scene(Kind.FILL)).named_parameters()}
    assert names == {"points", "colors", "opacities"}
    soft = {name for name, _ in Module(random_scene(Kind.STROKE), renderer="gaussian").named_parameters()}
    assert soft == {*names, "widths", "fades"}
    every = {name for name, _ in Module(with_gradients(mixed_scene())).named_parameters()}
    assert every == {*names, "widths", "frames", "stop_offsets", "stop_colors", "stop_opacities"}


def test_rates_are_those_of_a_run() -> None:
    """A canvas of 2000 px is trained at 1131: a pixel there is 1.77 units."""
    scene = random_scene(Kind.STROKE, 2, 2000, 2000)
    groups = {group["name"]: group["lr"] for group in Module(scene).parameter_groups(rate=0.5)}
    assert groups["colors"] == pytest.approx(0.5 * 0.02)
    assert groups["points"] == pytest.approx(0.5 * 3.0 * 2000 / 1265, rel=1e-3)
    assert groups["points"] == pytest.approx(10 * groups["widths"])
    settings = make_settings(rates={"points": 7.0})
    own = {group["name"]: group["lr"] for group in Module(scene).parameter_groups(settings)}
    assert own["points"] == pytest.approx(7.0 * 2000 / 1265, rel=1e-3)


def test_project_brings_all_back_into_bounds() -> None:
    module = Module(random_scene(Kind.STROKE))
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.copy_(torch.where(torch.rand(parameter.shape) < 0.5, -1e6, 1e6))
    module.project()
    shown = module.tensors().values
    assert {round(x, 4) for x in shown["opacities"].tolist()} <= set(OPACITY_RANGE)
    assert set(shown["colors"].flatten().tolist()) <= {0.0, 1.0}
    assert set(shown["points"].flatten().tolist()) <= {-40.0, 80.0}
    assert set(shown["widths"].tolist()) <= {1.0, 40.0}


def test_training_comes_near_to_its_target() -> None:
    wanted = render(SceneTensors.of(disc(11, 40, 22)))
    start = disc(6, 40, 14)
    module = Module(replace(start, colors=np.full((1, 3), 0.5, np.float32)))
    optimizer = torch.optim.Adam(module.parameter_groups(rate=0.5), betas=(0.9, 0.99))
    losses = []
    for _ in range(60):
        optimizer.zero_grad()
        loss = (over(module(), 0.0) - wanted[..., :3]).square().mean()
        loss.backward()
        optimizer.step()
        module.project()
        losses.append(loss.item())
    assert losses[-1] < losses[0] / 30


def test_twins_stay_one() -> None:
    module = Module(twins())
    optimizer = torch.optim.Adam(module.parameter_groups())
    for _ in range(3):
        optimizer.zero_grad()
        module().square().sum().backward()
        optimizer.step()
    scene = module.scene()
    np.testing.assert_array_equal(scene.points_of(0), scene.points_of(1))
    assert scene.twin.tolist() == [0, 1]
    assert not np.array_equal(scene.points_of(0), twins().points_of(0))
    both = SceneTensors.of(twins(), requires_grad=True)
    render(both).square().sum().backward()
    own = Module(twins())
    own().square().sum().backward()
    points = both.values["points"].grad
    assert points is not None
    half = len(points) // 2
    gradient = dict(own.named_parameters())["points"].grad
    assert gradient is not None
    torch.testing.assert_close(gradient[:half], points[:half] + points[half:])


def test_twins_that_part_are_two_shapes() -> None:
    tensors = SceneTensors.of(twins())
    assert tensors.scene().twin.tolist() == [0, 1]
    tensors.values["points"][0] += 1
    assert tensors.scene().twin.tolist() == [0, 0]


def test_the_scene_holds_what_a_file_can() -> None:
    tensors = SceneTensors.of(with_gradients(random_scene(Kind.FILL)))
    tensors.values["opacities"].fill_(1.2)
    tensors.values["stop_offsets"].fill_(-3)
    tensors.values["colors"].fill_(2)
    scene = tensors.scene()
    assert (scene.opacities == 1).all()
    assert (scene.stop_offsets == 0).all()
    assert (scene.colors == 1).all()
    assert (scene.paint[:-1] != Paint.FLAT).all()
    tensors.values["points"][0, 0] = torch.nan
    with pytest.raises(ValueError, match="points holds numbers that are not finite"):
        tensors.scene()


def test_the_file_shows_what_the_module_does() -> None:
    module = Module(random_scene(Kind.FILL, 5, 64, 64))
    read = load_scene(module.to_svg(), 64, 64, "a file")[0]
    assert (render(SceneTensors.of(read)) - module()).abs().mean() < 2e-3


def test_a_module_is_saved_and_loaded() -> None:
    first = Module(random_scene(Kind.FILL, seed=1))
    second = Module(replace(random_scene(Kind.FILL, seed=2)))
    second.load_state_dict(first.state_dict())
    assert torch.equal(first(), second())
