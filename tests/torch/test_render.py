"""``warpsplat.torch.render``: the renderer's image, calls in any order, transforms."""

from __future__ import annotations

import functools
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch.func import functional_call, grad, hessian, jacrev, jvp, vjp, vmap

from tests import ROOT
from tests.scenes import disc, mixed_scene, random_scene
from warpsplat.extensions import renderer_names
from warpsplat.fit.renderers import renderer_of
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render as native_render
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.torch import Module, SceneTensors, over, render, tensors

FILL = Kind.FILL
Tensor = torch.Tensor


def loss_of(scene: SceneTensors, **options: Any) -> Tensor:
    return render(scene, **options).square().sum()


def points_grad(loss: Tensor, scene: SceneTensors, **options: Any) -> Tensor:
    (gradient,) = torch.autograd.grad(loss, [scene.values["points"]], **options)
    return gradient


def same(one: object, other: object) -> None:
    torch.testing.assert_close(one, other, rtol=0, atol=0)


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


@pytest.mark.parametrize("name", renderer_names())
def test_every_model_on_a_transparent_canvas(name: str) -> None:
    scene = replace(random_scene(FILL, seed=1), canvas=Canvas(40, 36, None))
    native = native_render(scene, model=renderer_of(name).default_model, backend=Backend.on("cpu"))
    np.testing.assert_allclose(render(SceneTensors.of(scene), renderer=name).numpy(), native, atol=1e-5)


def test_opaque_shapes_and_no_shapes() -> None:
    white = disc(60, 40, 20)
    assert (render(SceneTensors.of(white)) - 1).abs().max() < 1e-5
    nothing = SceneTensors.of(random_scene(FILL).take(np.arange(0)), requires_grad=True)
    image = render(nothing)
    assert nothing.layout.canvas.background is not None
    np.testing.assert_allclose(image[0, 0, :3].detach(), nothing.layout.canvas.background)
    image.sum().backward()


def test_values_are_clamped_and_have_the_gradient_there() -> None:
    gradients = []
    for opacities in ([1.5, -0.2, 0.5], [1, 0, 0.5]):
        scene = replace(random_scene(FILL, 3), opacities=np.array(opacities, np.float32))
        tensors = SceneTensors.of(scene, requires_grad=True)
        loss_of(tensors).backward()
        gradients.append(tensors.values["opacities"].grad)
    torch.testing.assert_close(*gradients)


@pytest.mark.parametrize("size", [{"width": 80}, {"height": 18}, {"width": 60, "height": 54}])
def test_one_side_gives_the_other(size: dict[str, int]) -> None:
    height, width, planes = render(SceneTensors.of(random_scene(FILL)), **size).shape
    assert {"width": width, "height": height}.items() >= size.items()
    assert (10 * height, planes) == (9 * width, 4)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_calls_do_not_disturb_one_another(order: tuple[int, int]) -> None:
    """Two scenes of one engine: forward, forward, backward, backward, and one backward pass again."""
    scenes = [moved(random_scene(FILL), by) for by in (0.0, 3.0)]
    alone = [points_grad(loss_of(scene), scene) for scene in scenes]
    images = [render(scene) for scene in scenes]
    copies = [image.detach().clone() for image in images]
    losses = [image.square().sum() for image in images]
    found = {i: points_grad(losses[i], scenes[i], retain_graph=True) for i in (*order, *order)}
    for i in order:
        same(found[i], alone[i])
        same(points_grad(losses[i], scenes[i]), alone[i])
        same(images[i], copies[i])
    assert not torch.equal(*alone)


def test_backward_passes_that_are_refused() -> None:
    scene = moved(random_scene(FILL), 0.0)
    gradient = points_grad(loss_of(scene), scene, create_graph=True)
    with pytest.raises(RuntimeError, match="differentiate twice"):
        gradient.sum().backward()
    loss = loss_of(scene)
    with torch.no_grad():
        scene.values["points"].add_(1)
    with pytest.raises(RuntimeError, match="inplace operation"):
        loss.backward()


@pytest.mark.parametrize("threads", [1, 2])
def test_several_threads_find_what_one_finds(threads: int) -> None:
    """Some of them render the same layout, and so share buffers."""
    scenes = [moved(random_scene(FILL, 6, seed=k // 2), float(k % 2)) for k in range(6)]
    alone = [points_grad(loss_of(scene), scene) for scene in scenes]

    def work(scene: SceneTensors) -> list[Tensor]:
        return [points_grad(loss_of(scene, threads=threads), scene) for _ in range(8)]

    with ThreadPoolExecutor(len(scenes)) as pool:
        for gradients, want in zip(pool.map(work, scenes), alone, strict=True):
            for gradient in gradients:
                same(gradient, want)


def test_float64_is_rendered_in_float32_and_has_gradients_of_float64(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tensors, "_warn_of_float64", functools.cache(tensors._warn_of_float64.__wrapped__))
    scene = moved(random_scene(FILL), 0.0)
    double = scene.values["points"].detach().double().requires_grad_()
    with pytest.warns(UserWarning, match="float32"):
        render(SceneTensors(scene.layout, {"points": double}))
    (gradient,) = torch.autograd.grad(loss_of(SceneTensors(scene.layout, {"points": double})), [double])
    assert gradient.dtype == torch.float64
    same(gradient.float(), points_grad(loss_of(scene), scene))


def test_over() -> None:
    scene = random_scene(FILL)
    clear = render(SceneTensors.of(replace(scene, canvas=Canvas(40, 36, None))))
    opaque, background = render(SceneTensors.of(scene))[..., :3], torch.tensor(scene.canvas.background)
    torch.testing.assert_close(over(clear, background.tolist()), opaque, rtol=0, atol=1e-5)
    torch.testing.assert_close(over(clear, torch.zeros(36, 40, 3)), clear[..., :3])


def test_without_torch_one_line_says_what_to_do() -> None:
    code = "import sys; sys.modules['torch'] = None; import warpsplat.torch"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    message = "ImportError: warpsplat.torch needs PyTorch: pip install warpsplat[torch]"
    assert done.stderr.splitlines()[-1] == message


LAYOUT = random_scene(Kind.FILL, 3)
POINTS = torch.tensor(LAYOUT.points)
OPACITIES = torch.tensor(LAYOUT.opacities)
BATCH = torch.stack([POINTS, POINTS + 1, POINTS - 3])
"""Shape (scene, point, 2)."""
FAINT_TO_OPAQUE = torch.stack([OPACITIES * 0.3, OPACITIES, torch.ones_like(OPACITIES)])


def planes(points: Tensor, opacities: Tensor = OPACITIES) -> Tensor:
    """Return the mean square of each plane of the image, shape (4,)."""
    return render(SceneTensors(LAYOUT, {"points": points, "opacities": opacities})).square().mean(dim=(0, 1))


def loss(points: Tensor, opacities: Tensor) -> Tensor:
    return planes(points, opacities).sum()


def plain(points: Tensor, opacities: Tensor) -> tuple[Tensor, ...]:
    inputs = points.clone().requires_grad_(), opacities.clone().requires_grad_()
    return torch.autograd.grad(loss(*inputs), inputs)


def test_grad_and_vjp() -> None:
    same(grad(loss, (0, 1))(POINTS, OPACITIES), plain(POINTS, OPACITIES))
    pull = vjp(planes, POINTS)[1]
    jacobian = jacrev(planes)(POINTS)
    same(jacobian[1], pull(torch.eye(4)[1].float())[0])
    torch.testing.assert_close(jacobian.sum(dim=0), plain(POINTS, OPACITIES)[0])


def test_vmap_is_the_call_with_a_list() -> None:
    scenes = [SceneTensors(LAYOUT, {"points": each}) for each in BATCH]
    same(vmap(lambda each: render(SceneTensors(LAYOUT, {"points": each})))(BATCH), render(scenes))
    same(vmap(planes, in_dims=(2, None))(BATCH.movedim(0, 2), OPACITIES), torch.stack([*map(planes, BATCH)]))


def test_vmap_of_grad_and_grad_of_vmap() -> None:
    """Scenes of a batch differ in whether one of their shapes is opaque, which takes another adjoint."""
    wanted = [plain(*each) for each in zip(BATCH, FAINT_TO_OPAQUE, strict=True)]
    stacked = tuple(map(torch.stack, zip(*wanted, strict=True)))
    same(vmap(grad(loss, (0, 1)))(BATCH, FAINT_TO_OPAQUE), stacked)
    inputs = BATCH.clone().requires_grad_(), FAINT_TO_OPAQUE.clone().requires_grad_()
    same(torch.autograd.grad(vmap(loss)(*inputs).sum(), inputs), stacked)


def test_a_module_as_a_function_of_its_parameters() -> None:
    module = Module(LAYOUT)
    parameters = {name: value.detach() for name, value in module.named_parameters()}
    found = grad(lambda own: functional_call(module, own, ()).square().mean())(parameters)
    module().square().mean().backward()
    same(found, {name: value.grad for name, value in module.named_parameters()})


@pytest.mark.filterwarnings("ignore::DeprecationWarning:torch.jit._script")  # torch uses it itself
def test_there_are_first_derivatives_only() -> None:
    with pytest.raises(RuntimeError, match="first derivatives only"):
        grad(lambda points: grad(loss)(points, OPACITIES).sum())(POINTS)
    for transform in (lambda: hessian(planes)(POINTS), lambda: jvp(planes, (POINTS,), (POINTS,))):
        with pytest.raises(NotImplementedError, match="forward mode"):
            transform()
