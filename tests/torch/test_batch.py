"""Several scenes in one call: each has a renderer of its own until its backward pass."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.scenes import random_scene
from warpsplat.scene import Kind, Scene
from warpsplat.torch import SceneTensors, clear_cache, kept, render
from warpsplat.torch.engine import Engine

Tensor = torch.Tensor


@pytest.fixture
def renders(monkeypatch: pytest.MonkeyPatch) -> list[Engine]:
    """Start without renderers; the one of each forward pass is added to the list."""
    clear_cache()
    done: list[Engine] = []
    own = Engine.forward

    def counted(engine: Engine, values: dict[str, Tensor]) -> None:
        done.append(engine)
        own(engine, values)

    monkeypatch.setattr(Engine, "forward", counted)
    return done


def shifted(count: int) -> list[Scene]:
    """Return scenes of one structure."""
    scene = random_scene(Kind.FILL, 5)
    return [replace(scene, points=scene.points + np.float32(i)) for i in range(count)]


def mixed() -> list[Scene]:
    """Return scenes of several structures, one of them opaque."""
    opaque = replace(random_scene(Kind.FILL, 4), opacities=np.ones(4, np.float32))
    return [*shifted(2), random_scene(Kind.STROKE, 3), opaque]


def found(scenes: list[Scene], threads: int, *, at_once: bool) -> list[Tensor]:
    """Return images and gradients."""
    tensors = [SceneTensors.of(scene, requires_grad=True) for scene in scenes]
    wanted = [[v for v in each.values.values() if v.requires_grad] for each in tensors]
    height, width = scenes[0].canvas.height, scenes[0].canvas.width
    weights = torch.rand(len(scenes), height, width, 4, generator=torch.Generator().manual_seed(0))
    if at_once:
        images = render(tensors, threads=threads)
        leaves = [leaf for own in wanted for leaf in own]
        return [*images.detach(), *torch.autograd.grad(images, leaves, weights)]
    images = torch.stack([render(each, threads=threads) for each in tensors])
    gradients = [
        torch.autograd.grad(render(each, threads=threads), own, weight)
        for each, own, weight in zip(tensors, wanted, weights, strict=True)
    ]
    return [*images.detach(), *(gradient for own in gradients for gradient in own)]


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
@pytest.mark.parametrize("scenes", [shifted(5), mixed(), shifted(1)], ids=["shifted", "mixed", "one"])
def test_bits_are_those_of_single_calls(scenes: list[Scene], threads: int) -> None:
    for one, other in zip(found(scenes, threads, at_once=True), found(scenes, 1, at_once=False), strict=True):
        assert torch.equal(one, other)


def test_each_scene_is_rendered_once(renders: list[Engine]) -> None:
    for step in range(3):
        found(shifted(5), 2, at_once=True)
        assert len(renders) == 5 * (step + 1)
    assert len(set(renders)) == len(kept.engines) == 5


def test_without_memory_images_are_rendered_again(
    renders: list[Engine], monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = found(shifted(4), 1, at_once=True)
    clear_cache()
    renders.clear()
    monkeypatch.setattr(kept, "_limit", lambda device: 1)
    assert all(map(torch.equal, found(shifted(4), 1, at_once=True), wanted))
    assert len(set(renders)) == 1
    assert len(renders) == 4 + 3  # the last image is still there


def test_a_renderer_is_free_where_no_backward_pass_can_come(renders: list[Engine]) -> None:
    tensors = SceneTensors.of(shifted(1)[0], requires_grad=True)
    with torch.no_grad():
        first = [render(tensors) for _ in range(2)]
    image = render(tensors)
    assert len(set(renders)) == 1
    other = render(tensors)
    assert len(set(renders)) == 2
    assert torch.equal(image, other)
    del image, other
    gc.collect()
    images = [render(tensors) for _ in range(2)]
    assert len(set(renders)) == len(kept.engines) == 2
    assert torch.equal(images[0], first[0])


@pytest.mark.parametrize("threads", [1, 3])
def test_a_scene_that_cannot_be_drawn_is_refused(threads: int) -> None:
    scenes = [SceneTensors.of(scene) for scene in shifted(3)]
    scenes[1].values["points"][0, 0] = float("nan")
    with pytest.raises(ValueError, match="points: numbers that are not finite"):
        render(scenes, threads=threads)
    assert torch.equal(render(scenes[::2], threads=threads)[1], render(scenes[2]))


def test_part_of_the_images_and_part_of_the_tensors() -> None:
    tensors = [SceneTensors.of(scene) for scene in shifted(3)]
    tensors[1].values["colors"].requires_grad_()
    render(tensors)[1].sum().backward()
    alone = tensors[1].values["colors"].detach().clone().requires_grad_()
    render(SceneTensors(tensors[1].layout, {**tensors[1].values, "colors": alone})).sum().backward()
    assert alone.grad is not None
    assert torch.equal(alone.grad, tensors[1].values["colors"].grad)
