"""``warpsplat.torch.render``: the renderer's image; calls in any order; what is refused."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from tests.scenes import disc, mixed_scene, random_scene
from warpsplat.errors import UsageError
from warpsplat.paper.models import GaussianModel, SplatModel
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.models import EXACT, Model
from warpsplat.rendering.renderer import render as native_render
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.torch import SceneTensors, over, render

FILL = Kind.FILL


def loss_of(scene: SceneTensors, **options: Any) -> torch.Tensor:
    return render(scene, **options).square().sum()


def points_grad(loss: torch.Tensor, scene: SceneTensors, **options: Any) -> torch.Tensor:
    (gradient,) = torch.autograd.grad(loss, [scene.values["points"]], **options)
    return gradient


def moved(scene: Scene, by: float) -> SceneTensors:
    return SceneTensors.of(replace(scene, points=scene.points + np.float32(by)), requires_grad=True)


@pytest.mark.parametrize(("width", "scale"), [(None, 1.0), (60, 1.5), (8, 0.2)])
def test_the_image_is_the_renderers(width: int | None, scale: float) -> None:
    scene = mixed_scene(seed=1)
    image = render(SceneTensors.of(scene), width)
    native = native_render(scene, scale=scale, backend=Backend.on("cpu"))
    assert image.dtype == torch.float32
    np.testing.assert_allclose(image[..., :3].numpy(), native, atol=1e-5)
    assert (image[..., 3] == 1).all()


@pytest.mark.parametrize(
    ("name", "model"), [("exact", EXACT), ("splat", SplatModel()), ("gaussian", GaussianModel())]
)
def test_every_model_on_a_transparent_canvas(name: str, model: Model) -> None:
    scene = replace(random_scene(FILL, seed=1), canvas=Canvas(40, 36, None))
    native = native_render(scene, model=model, backend=Backend.on("cpu"))
    np.testing.assert_allclose(render(SceneTensors.of(scene), renderer=name).numpy(), native, atol=1e-5)


def test_what_has_no_tensor_is_the_layouts() -> None:
    scene = random_scene(FILL)
    for changed in (scene, replace(scene, colors=1 - scene.colors)):
        np.testing.assert_array_equal(
            render(SceneTensors(changed, {})), render(SceneTensors.of(changed)), "the same engine"
        )


def test_opaque_is_opaque_and_no_shape_is_no_trouble() -> None:
    white = disc(60, 40, 20)
    assert (render(SceneTensors.of(white)) - 1).abs().max() < 1e-5
    nothing = SceneTensors.of(random_scene(FILL).take(np.arange(0)), requires_grad=True)
    image = render(nothing)
    assert nothing.layout.canvas.background is not None
    np.testing.assert_allclose(image[0, 0, :3].detach(), nothing.layout.canvas.background)
    image.sum().backward()


def test_values_without_sense_are_drawn_as_the_nearest_with_its_gradient() -> None:
    scene = random_scene(FILL, 3)
    beyond = SceneTensors.of(
        replace(scene, opacities=np.array([1.5, -0.2, 0.5], np.float32)), requires_grad=True
    )
    within = SceneTensors.of(replace(scene, opacities=np.array([1, 0, 0.5], np.float32)), requires_grad=True)
    for one in (beyond, within):
        loss_of(one).backward()
    torch.testing.assert_close(beyond.values["opacities"].grad, within.values["opacities"].grad)


def test_a_size_from_one_side() -> None:
    scene = SceneTensors.of(random_scene(FILL))
    assert render(scene, 80).shape == (72, 80, 4)
    assert render(scene, height=18).shape == (18, 20, 4)
    assert render(scene, 60, 54).shape == (54, 60, 4)


def test_a_list_of_scenes_is_each_of_them() -> None:
    scenes = [
        SceneTensors.of(random_scene(kind, 3, seed=k), requires_grad=True) for k, kind in enumerate(Kind)
    ]
    scenes.append(moved(random_scene(FILL, 3), 2.0))
    images = render(scenes)
    assert images.shape == (3, 36, 40, 4)
    images.square().sum().backward()
    for image, scene in zip(images, scenes, strict=True):
        torch.testing.assert_close(image, render(scene), rtol=0, atol=0)
        alone = points_grad(loss_of(scene), scene)
        torch.testing.assert_close(scene.values["points"].grad, alone, rtol=0, atol=0)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_two_forwards_then_two_backwards(order: tuple[int, int]) -> None:
    scenes = [moved(random_scene(FILL), by) for by in (0.0, 3.0)]
    alone = [points_grad(loss_of(scene), scene) for scene in scenes]
    losses = [loss_of(scene) for scene in scenes]
    for i in order:
        torch.testing.assert_close(points_grad(losses[i], scenes[i]), alone[i], rtol=0, atol=0)
    assert not torch.equal(*alone)


def test_two_backwards_of_one_forward() -> None:
    scene = moved(random_scene(FILL), 0.0)
    loss = loss_of(scene)
    first = points_grad(loss, scene, retain_graph=True)
    torch.testing.assert_close(points_grad(loss, scene), first, rtol=0, atol=0)


def test_an_image_that_is_kept_stays_as_it_is() -> None:
    scenes = [moved(random_scene(FILL), by) for by in (0.0, 3.0)]
    first = render(scenes[0])
    before = first.detach().clone()
    render(scenes[1]).sum().backward()
    assert torch.equal(first, before)


def test_gradients_that_are_kept_stay_as_they_are() -> None:
    scenes = [moved(random_scene(FILL), by) for by in (0.0, 3.0)]
    first = points_grad(loss_of(scenes[0]), scenes[0])
    before = first.clone()
    points_grad(loss_of(scenes[1]), scenes[1])
    assert torch.equal(first, before)


def test_a_scene_changed_before_the_backward_pass_is_refused() -> None:
    scene = moved(random_scene(FILL), 0.0)
    loss = loss_of(scene)
    with torch.no_grad():
        scene.values["points"].add_(1)
    with pytest.raises(RuntimeError, match="inplace operation"):
        loss.backward()


def test_double_backward_is_refused_in_one_line() -> None:
    scene = moved(random_scene(FILL), 0.0)
    gradient = points_grad(loss_of(scene), scene, create_graph=True)
    with pytest.raises(RuntimeError, match=r"\Awarpsplat.torch.render has first derivatives only.*\Z"):
        gradient.sum().backward()


@pytest.mark.parametrize("threads", [1, 2])
def test_several_threads_find_what_one_finds(threads: int) -> None:
    """Some of them with the same layout, and so the same buffers."""
    scenes = [moved(random_scene(FILL, 6, seed=k // 2), float(k % 2)) for k in range(6)]
    alone = [points_grad(loss_of(scene), scene) for scene in scenes]
    found: list[list[torch.Tensor]] = [[] for _ in scenes]

    def work(i: int) -> None:
        for _ in range(8):
            found[i].append(points_grad(loss_of(scenes[i], threads=threads), scenes[i]))

    crew = [threading.Thread(target=work, args=(i,)) for i in range(len(scenes))]
    for each in crew:
        each.start()
    for each in crew:
        each.join()
    for gradients, want in zip(found, alone, strict=True):
        assert len(gradients) == 8
        for gradient in gradients:
            torch.testing.assert_close(gradient, want, rtol=0, atol=0)


def test_over() -> None:
    scene = random_scene(FILL)
    clear = render(SceneTensors.of(replace(scene, canvas=Canvas(40, 36, None))))
    opaque = render(SceneTensors.of(scene))[..., :3]
    assert scene.canvas.background is not None
    torch.testing.assert_close(over(clear, scene.canvas.background.tolist()), opaque, rtol=0, atol=1e-5)
    torch.testing.assert_close(over(clear, torch.zeros(36, 40, 3)), clear[..., :3])


def values(**changed: Any) -> Callable[[], object]:
    scene = random_scene(FILL)
    return lambda: render(SceneTensors(scene, {"points": torch.tensor(scene.points), **changed}))


FAST: Any = "fast"
SPLINES = mixed_scene(seed=1)
REFUSED: dict[str, tuple[type[Exception], str, Callable[[], object]]] = {
    "name": (ValueError, "no attribute 'colour'", values(colour=torch.zeros(4))),
    "shape": (ValueError, r"colors has shape \(3,\), not \(4, 3\)", values(colors=torch.zeros(3).float())),
    "float64": (TypeError, "colors is torch.float64", values(colors=torch.zeros(4, 3).double())),
    "array": (TypeError, "colors is a ndarray", values(colors=np.zeros((4, 3), np.float32))),
    "device": (ValueError, "colors is on meta", values(colors=torch.zeros(4, 3, device="meta").float())),
    "nan": (ValueError, "colors: numbers that are not finite", values(colors=torch.zeros(4, 3).float() / 0)),
    "focus": (ValueError, "focus has no gradient", values(focus=torch.zeros(4, 3).float().requires_grad_())),
    "width": (UsageError, "width must be a number of pixels", lambda: render(SceneTensors(SPLINES, {}), 0)),
    "size": (UsageError, "would stretch", lambda: render(SceneTensors(SPLINES, {}), 40, 72)),
    "model": (UsageError, "not 'fast'", lambda: render(SceneTensors(SPLINES, {}), renderer=FAST)),
    "spline": (ValueError, "is a spline", lambda: render(SceneTensors(SPLINES, {}), renderer="splat")),
    "none": (UsageError, "no scene", lambda: render([])),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_in_one_line(case: str) -> None:
    kind, message, call = REFUSED[case]
    with pytest.raises(kind, match=message) as raised:
        call()
    assert "\n" not in str(raised.value)
