"""Tensors of shapes and groups -> attributes of our scene, by operations that torch differentiates."""

from __future__ import annotations

import math

import torch

from warpsplat.pydiffvg.arguments import SceneArguments
from warpsplat.pydiffvg.gather import GatherAll
from warpsplat.pydiffvg.layout import GradientTensors, Layout

Tensor = torch.Tensor


def assemble(scene: SceneArguments, layout: Layout) -> dict[str, Tensor]:
    """Return the attributes of ``layout.scene`` by name, in pixels of the image."""
    canvas = layout.scene.canvas
    scale = canvas.width / scene.width, canvas.height / scene.height
    numbers, points, colors, opacities, *widths = GatherAll.apply(
        scene.places, layout.gathers, *scene.joined()
    )
    if layout.order is not None:
        points = torch.cat([points, *(area.points(numbers) for area in layout.areas)])
        points = points.index_select(0, layout.order)
    widths = [2 * math.sqrt(scale[0] * scale[1]) * each for each in widths]
    if layout.transforms is not None:
        matrices = numbers.index_select(0, layout.transforms.entries).view(-1, 3, 3)
        own = matrices.index_select(0, layout.transforms.point_group)
        points = torch.einsum("pij,pj->pi", own[:, :2, :2], points) + own[:, :2, 2]
        if widths:
            areas = matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0]
            widths[0] = widths[0] * areas.abs().sqrt().index_select(0, layout.transforms.row_group)
    if scale != (1.0, 1.0):
        points = points * torch.tensor(scale, device=points.device)
    values = layout.defaults | {"points": points, "colors": colors, "opacities": opacities}
    if widths:
        values["widths"] = widths[0].clamp_min(0)
    if layout.gradients is not None:
        values |= _gradients(numbers, layout.gradients, torch.tensor(scale, device=numbers.device))
    return values


def _gradients(numbers: Tensor, gradients: GradientTensors, scale: Tensor) -> dict[str, Tensor]:
    """Return frames and stops of gradients; ``scale``: canvas units -> pixels, shape (2,)."""
    first, second = numbers.index_select(0, gradients.points).view(-1, 2, 2).unbind(dim=1)
    axis = (second - first) * scale
    square = axis.square().sum(dim=1, keepdim=True).clamp_min(1e-12)
    # DiffVG divides by the squared length of a linear gradient [px^2], or by this where that is less.
    least_square = 1e-3
    axis = axis * (least_square / square).clamp_min(1.0).detach()
    linear = torch.cat([first * scale, axis, -axis[:, 1:], axis[:, :1]], dim=1)
    center, radius = first * scale, second * scale
    zeros = torch.zeros_like(radius)
    radial = torch.cat([center, radius[:, :1], zeros, radius[:, 1:]], dim=1)
    colors = numbers.index_select(0, gradients.colors).view(-1, 4)
    return {
        "frames": torch.where(gradients.is_radial, radial, linear),
        "stop_offsets": numbers.index_select(0, gradients.offsets),
        "stop_colors": colors[:, :3],
        "stop_opacities": colors[:, 3],
    }
