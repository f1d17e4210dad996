"""Engines that are kept: as few as needed, and no more than allowed; several scenes in one call."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from tests.scenes import random_scene, styled_scene
from warpsplat.errors import UsageError
from warpsplat.rendering import kernel_cache
from warpsplat.scene import Cap, Join, Kind, Scene
from warpsplat.torch import SceneTensors, clear_cache, kept, passes, render


def step(scene: Scene, width: int = 40) -> torch.Tensor:
    tensors = SceneTensors.of(scene, requires_grad=True)
    loss = render(tensors, width).square().sum()
    loss.backward()
    return loss.detach()


@pytest.fixture(autouse=True)
def empty() -> None:
    clear_cache()


def with_canvas(scene: Scene, **changed: Any) -> Scene:
    return replace(scene, canvas=replace(scene.canvas, **changed))


@pytest.mark.parametrize(
    ("engines", "change"),
    [
        (1, lambda scene: replace(scene, points=scene.points + np.float32(3), first=scene.first.copy())),
        (2, lambda scene: random_scene(Kind.FILL)),
        (2, lambda scene: replace(scene, rule=1 - scene.rule)),
        (2, lambda scene: with_canvas(scene, background=np.zeros(3, np.float32))),
        (2, lambda scene: with_canvas(scene, width=39)),
        (2, lambda scene: replace(scene, cap=scene.cap + 1)),
        (2, lambda scene: replace(scene, dashes=tuple((start, 2.0, 9.0) for start, *_ in scene.dashes))),
    ],
)
def test_scenes_of_one_structure_share_an_engine(engines: int, change: Callable[[Scene], Scene]) -> None:
    scene = styled_scene(Cap.BUTT, Join.BEVEL, 1)
    images = [render(SceneTensors.of(each)) for each in (scene, change(scene), scene)]
    assert torch.equal(images[0], images[2])
    assert len(kept.engines) == engines


def test_changing_scenes_do_not_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    step(random_scene(Kind.FILL, 2))
    monkeypatch.setattr(kernel_cache, "compile_later", None)
    monkeypatch.setattr(kept, "KEPT", 3)
    for count in range(3, 8):
        step(random_scene(Kind.FILL, count))
    assert len(kept.engines) == 3


@pytest.mark.skipif(sys.platform != "linux", reason="asks the system for the size of the process")
def test_many_steps_need_no_more_memory() -> None:
    """Images and gradients of a quarter of a megabyte: one in five that is kept would show."""

    def resident() -> int:
        with open("/proc/self/statm", encoding="ascii") as sizes:
            return int(sizes.read().split()[1]) * 4096

    before = 0
    for number in range(110):
        step(random_scene(Kind.FILL, 3, 128, 128), 128)
        if number == 30:
            before = resident()
    assert resident() - before < 4e6


@pytest.fixture
def capturing(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Pretend that a CUDA graph is being captured: everything but CUDA's own part."""

    def pretend(value: bool) -> None:
        for module in (kept, passes):
            monkeypatch.setattr(module, "is_capturing", lambda device: value)

    return pretend


def test_a_captured_engine_stays_as_it_is(capturing: Callable[[bool], None]) -> None:
    """A graph replays its launches without a call, whatever other calls do meanwhile."""
    scene = random_scene(Kind.FILL, 3)
    wanted = step(scene)
    ((_, warm),) = kept.engines
    capturing(True)
    assert torch.equal(step(scene), wanted)
    launches = warm._renderer.forward_program
    with np.errstate(all="ignore"):
        crowded = replace(scene, points=40 * scene.points - 800)
        nowhere = replace(scene, points=scene.points * np.float32("nan"))
    for one in (crowded, nowhere):  # nothing is read back, so nothing grows, and nothing is refused
        render(SceneTensors.of(one), 40)
    assert warm._renderer.forward_program is launches
    capturing(False)
    step(scene)
    assert warm not in [each for _, each in kept.engines]
    assert list(kept.captured.values()) == [warm]
    clear_cache()
    assert not kept.captured


def test_opacities_in_a_graph_stay_where_their_adjoint_is_right(capturing: Callable[[bool], None]) -> None:
    scene = random_scene(Kind.FILL, 3)
    step(scene)
    capturing(True)
    opaque = replace(scene, opacities=np.ones(3, np.float32))
    tensors = SceneTensors.of(opaque, requires_grad=True)
    image = render(tensors, 40)
    image.sum().backward()
    assert all(value.grad.isfinite().all() for value in tensors.values.values() if value.grad is not None)
    capturing(False)
    assert (image - render(tensors, 40)).abs().max() < 3e-3


def test_capturing_an_unrendered_scene_is_refused(capturing: Callable[[bool], None]) -> None:
    capturing(True)
    with pytest.raises(UsageError, match="rendered before"):
        step(random_scene(Kind.FILL, 3))


def shifted(count: int) -> list[Scene]:
    """Return scenes of one structure."""
    scene = random_scene(Kind.FILL, 5)
    return [replace(scene, points=scene.points + np.float32(i)) for i in range(count)]


def mixed() -> list[Scene]:
    """Return scenes of several structures, one of them opaque."""
    opaque = replace(random_scene(Kind.FILL, 4), opacities=np.ones(4, np.float32))
    return [*shifted(2), random_scene(Kind.STROKE, 3), opaque]


def found(scenes: list[Scene], threads: int, *, at_once: bool) -> list[torch.Tensor]:
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
def test_a_batch_has_the_bits_of_single_calls(scenes: list[Scene], threads: int) -> None:
    for one, other in zip(found(scenes, threads, at_once=True), found(scenes, 1, at_once=False), strict=True):
        assert torch.equal(one, other)


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
