"""``warpsplat.torch.render``: the renderer's image, and gradients through torch."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.scenes import mixed_scene, random_scene
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.models import SplatModel
from warpsplat.rendering.renderer import render as native_render
from warpsplat.scene import Kind
from warpsplat.torch import SceneTensors, render


@pytest.mark.parametrize("scale", [1, 2])
def test_the_image_is_the_renderers(scale: int) -> None:
    scene = mixed_scene(seed=1)
    image = render(SceneTensors.of(scene), 40 * scale)
    assert image.shape == (36 * scale, 40 * scale, 4)
    native = native_render(scene, scale=scale, backend=Backend.on("cpu"))
    np.testing.assert_allclose(image[..., :3].numpy(), native, atol=1e-5)
    assert (image[..., 3] == 1).all()


def test_a_splat_image_is_the_renderers() -> None:
    scene = mixed_scene(seed=1, splines=False)
    image = render(SceneTensors.of(scene), renderer="splat")
    native = native_render(scene, model=SplatModel(), backend=Backend.on("cpu"))
    np.testing.assert_allclose(image[..., :3].numpy(), native, atol=1e-5)


def test_double_backward_is_refused_in_one_line() -> None:
    tensors = SceneTensors.of(random_scene(Kind.FILL), requires_grad=True)
    (gradient,) = torch.autograd.grad(
        (render(tensors) ** 2).sum(), [tensors.values["points"]], create_graph=True
    )
    with pytest.raises(RuntimeError, match=r"\Awarpsplat.torch.render has first derivatives only.*\Z"):
        gradient.sum().backward()
