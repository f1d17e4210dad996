"""Gradients through torch against the float64 references."""

from __future__ import annotations

import numpy as np
import torch

from tests.helpers import reference_image, relative_error, renderer_for
from warpsplat.fit.renderers import renderer_of
from warpsplat.scene import Scene
from warpsplat.torch import SceneTensors, render


def compare(
    scene: Scene, name: str = "exact", scale: float = 1.0, *, tolerance: float = 1e-3
) -> SceneTensors:
    """Image and gradients of all attributes, for a random gradient of the image."""
    model = renderer_of(name).default_model
    plan = renderer_for(scene, "cpu", scale, model=model)
    if name == "gaussian":
        from tests.paper.helpers import soft_image

        p, image = soft_image(scene, plan)
    else:
        p, image = reference_image(scene, plan)
    planes = image.shape[2]
    weights = np.random.default_rng(1).normal(size=tuple(image.shape))
    (image * torch.tensor(weights)).sum().backward()
    found = SceneTensors.of(scene, requires_grad=True)
    shown = render(found, plan.viewport.width, renderer=model)
    # The cut makes single pixels differ where float32 and float64 decide differently.
    atol = {"exact": 2e-4, "splat": 2e-3, "gaussian": 2e-2}[name]
    difference = np.abs(shown[..., :planes].detach().numpy() - image.detach().numpy())
    assert difference.max() < atol
    assert difference.mean() < 5e-6
    (shown[..., :planes] * torch.tensor(weights, dtype=torch.float32)).sum().backward()
    for attribute, value in found.values.items():
        want = p[attribute].grad
        if value.requires_grad and want is not None:
            assert value.grad is not None, attribute
            assert relative_error(value.grad.numpy(), want.numpy()) < tolerance, attribute
        elif value.requires_grad:
            assert value.grad is None or not value.grad.any(), attribute
    return found
