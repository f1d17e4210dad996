"""Colours that are not premultiplied, against float64 autograd."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.helpers import pieces_of, relative_error, renderer_for
from tests.reference import exact
from tests.reference.composite import straight
from tests.reference.curves import tensors
from tests.scenes import mixed_scene, random_scene, with_gradients
from warpsplat.rendering.models import EXACT
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.torch import SceneTensors
from warpsplat.torch.engine import RenderSpec
from warpsplat.torch.function import draw
from warpsplat.torch.tensors import attributes_of


def opaque_in_parts() -> Scene:
    """Return shapes that hide others, some that are faint, and an invisible one."""
    scene = random_scene(Kind.FILL, 6, seed=4)
    return replace(scene, opacities=np.array([0.7, 1, 0.001, 1, 0.3, 0.02], np.float32))


SCENES = {
    "mixed": lambda: mixed_scene(seed=1).take(np.arange(6)),
    "opaque": opaque_in_parts,
    "gradients": lambda: with_gradients(mixed_scene(seed=2).take(np.arange(6))),
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("threads", [1, 2])
def test_image_and_gradients(name: str, threads: int) -> None:
    """Compare with the reference, for a random gradient of the image."""
    scene = SCENES[name]()
    scene = replace(scene, canvas=Canvas(scene.canvas.width, scene.canvas.height, None))
    plan = renderer_for(scene, "cpu")
    v, p = plan.viewport, tensors(scene)
    image = straight(exact.coverages(scene, p, pieces_of(plan), v.width, v.height, v.scale), p, scene)
    # Where the image is faint, division by its opacity amplifies rounding errors.
    weights = torch.tensor(np.random.default_rng(1).normal(size=tuple(image.shape)))
    weights = weights * (image[..., 3:].detach() > 1e-2)
    (image * weights).sum().backward()
    found = SceneTensors.of(scene, requires_grad=True)
    spec = RenderSpec(scene, v, EXACT, torch.device("cpu"), threads, opaque=True, straight=True)
    shown = draw(spec, {a.name: found.value(a) for a in attributes_of(scene)})
    seen = image[..., 3] > 1e-2
    assert float((shown - image).detach()[seen].abs().max()) < 1e-3
    (shown * weights.float()).sum().backward()
    for attribute in attributes_of(scene):
        want, value = p[attribute.name].grad, found.values[attribute.name]
        if value.requires_grad and want is not None:
            assert value.grad is not None, attribute.name
            assert relative_error(value.grad.numpy(), want.numpy()) < 3e-3, attribute.name
