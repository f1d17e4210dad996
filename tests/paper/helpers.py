"""Grids of a renderer, and the reference of soft Gaussians."""

from __future__ import annotations

import torch

from tests.paper.reference import soft
from tests.paper.reference.grid import Plan
from tests.reference.composite import composite
from tests.reference.curves import Tensors, tensors
from warpsplat.paper.grid import Grid, GridBuffers
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import Scene


def grid_of(renderer: Renderer) -> GridBuffers:
    assert isinstance(renderer.geometry, Grid)
    return renderer.geometry.buffers


def plans_of(renderer: Renderer) -> list[Plan]:
    grids = grid_of(renderer).shape_grid.numpy()
    return [Plan(int(each["stations"]), int(each["rows"]), float(each["reach"])) for each in grids]


def soft_image(
    scene: Scene, renderer: Renderer, softness: float = 0.6, *, detach: bool = False
) -> tuple[Tensors, torch.Tensor]:
    """As ``tests.helpers.reference_image``, of soft Gaussians."""
    v, p = renderer.viewport, tensors(scene)
    covers = soft.coverages(
        scene, p, plans_of(renderer), v.width, v.height, v.scale, softness=softness, detach=detach
    )
    return p, composite(covers, p | {"opacities": torch.ones(len(scene))}, scene)
