"""Gradients through torch against the float64 references."""

from __future__ import annotations

import numpy as np
import torch

from tests.helpers import pieces_of, reference_image, relative_error, renderer_for
from tests.reference import exact
from tests.reference.composite import straight
from tests.reference.curves import Tensors, tensors
from warpsplat.fit.renderers import renderer_of
from warpsplat.rendering.models import EXACT
from warpsplat.scene import Scene
from warpsplat.torch import SceneTensors, render
from warpsplat.torch.engine import RenderSpec
from warpsplat.torch.function import draw
from warpsplat.torch.tensors import attributes_of


def compare(
    scene: Scene, name: str = "exact", scale: float = 1.0, *, tolerance: float = 1e-3
) -> SceneTensors:
    """Compare the image, and all gradients for a random gradient of the image."""
    model = renderer_of(name).default_model
    plan = renderer_for(scene, "cpu", scale, model=model)
    if name == "gaussian":
        from tests.paper.helpers import soft_image

        p, image = soft_image(scene, plan)
    else:
        p, image = reference_image(scene, plan)
    planes = image.shape[2]
    weights = torch.tensor(np.random.default_rng(1).normal(size=tuple(image.shape)))
    found = SceneTensors.of(scene, requires_grad=True)
    shown = render(found, plan.viewport.width, renderer=model)[..., :planes]
    # The cut makes single pixels differ where float32 and float64 decide differently.
    atol = {"exact": 2e-4, "splat": 2e-3, "gaussian": 2e-2}[name]
    difference = (shown - image).detach().abs()
    assert float(difference.max()) < atol
    assert float(difference.mean()) < 5e-6
    (image * weights).sum().backward()
    (shown * weights.float()).sum().backward()
    compare_gradients(found, p, tolerance)
    return found


def compare_straight(scene: Scene, threads: int) -> None:
    """Compare as ``compare``, without premultiplying colours."""
    plan = renderer_for(scene, "cpu")
    v, p = plan.viewport, tensors(scene)
    image = straight(exact.coverages(scene, p, pieces_of(plan), v.width, v.height, v.scale), p, scene)
    # Where the image is faint, division by its opacity amplifies rounding errors.
    seen = image[..., 3:].detach() > 1e-2
    weights = torch.tensor(np.random.default_rng(1).normal(size=tuple(image.shape))) * seen
    found = SceneTensors.of(scene, requires_grad=True)
    spec = RenderSpec(scene, v, EXACT, torch.device("cpu"), threads, opaque=True, straight=True)
    shown = draw([spec], [{a.name: found.value(a) for a in attributes_of(scene)}]).squeeze(0)
    assert float(((shown - image).detach() * seen).abs().max()) < 1e-3
    (image * weights).sum().backward()
    (shown * weights.float()).sum().backward()
    compare_gradients(found, p, 3e-3)


def compare_gradients(found: SceneTensors, wanted: Tensors, tolerance: float) -> None:
    for name, value in found.values.items():
        want = wanted[name].grad
        if value.requires_grad and want is not None:
            assert value.grad is not None, name
            assert relative_error(value.grad.numpy(), want.numpy()) < tolerance, name
        elif value.requires_grad:
            assert value.grad is None or not value.grad.any(), name
