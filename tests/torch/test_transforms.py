"""``torch.func``: each transform finds what plain differentiation finds, scene by scene."""

from __future__ import annotations

import pytest
import torch
from torch.func import functional_call, grad, hessian, jacrev, jvp, vjp, vmap

from tests.scenes import random_scene
from warpsplat.scene import Kind
from warpsplat.torch import Module, SceneTensors, render

Tensor = torch.Tensor
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


def same(one: object, other: object) -> None:
    torch.testing.assert_close(one, other, rtol=0, atol=0)


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
