"""Splines drawn by the paper's renderers, which know cubics only: converted exactly, with their gradients."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

import warpsplat
from tests.scenes import contours_scene
from warpsplat.errors import UsageError
from warpsplat.paper.chains import as_chains
from warpsplat.scene import Kind, Rule, Scene
from warpsplat.torch import SceneTensors, render

pytestmark = pytest.mark.usefixtures("single_precision")


def start(*, open: bool) -> Scene:
    pixels = np.random.default_rng(0).integers(0, 256, (32, 32, 3)).astype(np.uint8)
    return warpsplat.starting_scene(pixels, 6, open=open)


@pytest.mark.parametrize("renderer", ["splat", "gaussian"])
@pytest.mark.parametrize("open", [False, True])
def test_the_image_equals_that_of_the_converted_cubics(renderer: str, open: bool) -> None:
    scene = start(open=open)
    tensors = SceneTensors.of(scene, requires_grad=True)
    image = render(tensors, renderer=renderer)
    assert torch.allclose(image, render(as_chains(scene), renderer=renderer), atol=2e-5)
    np.testing.assert_allclose(warpsplat.render(scene, renderer=renderer), image.detach().numpy(), atol=2e-5)


def test_gradients_equal_those_of_the_converted_cubics() -> None:
    scene = start(open=False)
    tensors = SceneTensors.of(scene, requires_grad=True)
    render(tensors, renderer="splat").square().sum().backward()
    cubics = SceneTensors.of(as_chains(scene), requires_grad=True)
    render(cubics, renderer="splat").square().sum().backward()
    found, inner = tensors.values["points"].grad, cubics.values["points"].grad
    assert found is not None and inner is not None
    # Moving all points of a shape moves all points of its cubics: the sums of both gradients are equal.
    for first, last, low, high in zip(
        scene.first, scene.first[1:], cubics.layout.first, cubics.layout.first[1:], strict=False
    ):
        assert torch.allclose(found[first:last].sum(0), inner[low:high].sum(0), atol=1e-4)
    step = 1e-3 * torch.randn(found.shape, generator=torch.Generator().manual_seed(0))
    moved = as_chains(replace(scene, points=scene.points + step.numpy()))
    change = torch.tensor(moved.points) - cubics.values["points"].detach()
    assert torch.allclose((found * step).sum(), (inner * change).sum(), rtol=1e-2, atol=1e-5)


def test_several_contours_are_refused_in_one_line() -> None:
    scene = contours_scene(Kind.FILL, Rule.EVENODD)
    for draw in (render, warpsplat.render):
        with pytest.raises(
            UsageError, match="several contours, which the renderer splat cannot draw; the renderer exact"
        ):
            draw(scene, renderer="splat")
