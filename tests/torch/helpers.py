"""Gradients through torch against the float64 references."""

from __future__ import annotations

import numpy as np
import torch

from tests.helpers import pieces_of, reference_image, relative_error, renderer_for
from tests.reference import exact, soft
from tests.reference.composite import composite, straight
from tests.reference.curves import Tensors, tensors
from tests.reference.grid import Plan
from warpsplat.rendering.models import EXACT
from warpsplat.rendering.renderer import Renderer
from warpsplat.rendering.soft import SoftGrid
from warpsplat.scene import Scene
from warpsplat.torch import SceneTensors, render
from warpsplat.torch.engine import RenderSpec
from warpsplat.torch.function import MODELS, draw
from warpsplat.torch.tensors import attributes_of


def soft_image(scene: Scene, renderer: Renderer) -> tuple[Tensors, torch.Tensor]:
    """Return the parameters and the image of soft Gaussians, as ``reference_image``."""
    assert isinstance(renderer.geometry, SoftGrid)
    b, v, p = renderer.geometry.buffers, renderer.viewport, tensors(scene)
    arrays = (b.shape_stations.numpy(), b.shape_rows.numpy(), b.shape_reach.numpy())
    plans = [Plan(int(c), int(r), float(z)) for c, r, z in zip(*arrays, strict=True)]
    covers = soft.coverages(scene, p, plans, v.width, v.height, v.scale, softness=0.6, detach=False)
    return p, composite(covers, p | {"opacities": torch.ones(len(scene))}, scene)


def compare(
    scene: Scene, name: str = "exact", scale: float = 1.0, *, tolerance: float = 1e-3
) -> SceneTensors:
    """Compare the image, and all gradients for a random gradient of the image."""
    plan = renderer_for(scene, "cpu", scale, model=MODELS[name])
    p, image = (soft_image if name == "gaussian" else reference_image)(scene, plan)
    planes = image.shape[2]
    weights = torch.tensor(np.random.default_rng(1).normal(size=tuple(image.shape)))
    found = SceneTensors.of(scene, requires_grad=True)
    shown = render(found, plan.viewport.width, renderer=MODELS[name])[..., :planes]
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
    shown = draw(spec, {a.name: found.value(a) for a in attributes_of(scene)})
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
