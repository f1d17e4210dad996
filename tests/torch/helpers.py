"""Gradients through torch against the float64 references."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from tests.helpers import reference_image, relative_error, renderer_for
from tests.reference import soft
from tests.reference.composite import composite
from tests.reference.curves import Tensors, tensors
from tests.reference.grid import Plan
from warpsplat.rendering.models import Model
from warpsplat.rendering.renderer import Renderer
from warpsplat.rendering.soft import SoftGrid
from warpsplat.scene import Scene
from warpsplat.torch import SceneTensors, render
from warpsplat.torch.function import MODELS

Reference = Callable[[Scene, Renderer], tuple[Tensors, torch.Tensor]]


def soft_image(scene: Scene, renderer: Renderer) -> tuple[Tensors, torch.Tensor]:
    """As ``reference_image``, of soft Gaussians."""
    assert isinstance(renderer.geometry, SoftGrid)
    b, v, p = renderer.geometry.buffers, renderer.viewport, tensors(scene)
    arrays = (b.shape_stations.numpy(), b.shape_rows.numpy(), b.shape_reach.numpy())
    plans = [Plan(int(c), int(r), float(z)) for c, r, z in zip(*arrays, strict=True)]
    covers = soft.coverages(scene, p, plans, v.width, v.height, v.scale, softness=0.6, detach=False)
    return p, composite(covers, p | {"opacities": torch.ones(len(scene))}, scene)


def compare(
    scene: Scene, name: str = "exact", scale: float = 1.0, *, tolerance: float = 1e-3
) -> SceneTensors:
    """Image and gradients of all attributes, for a random gradient of the image."""
    model: Model = MODELS[name]
    plan = renderer_for(scene, "cpu", scale, model=model)
    p, image = (soft_image if name == "gaussian" else reference_image)(scene, plan)
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
