"""Coverages -> image."""

from __future__ import annotations

import torch

from tests.reference.curves import Tensors
from tests.reference.paint import pixel_paint
from warpsplat.kernels.constants import NOTHING, SEEN
from warpsplat.scene import Scene


def pixel_centres(width: int, height: int) -> torch.Tensor:
    """[height, width, 2]."""
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    return torch.stack([x, y], dim=2)


def composite(coverages: list[torch.Tensor], p: Tensors, scene: Scene, scale: float = 1.0) -> torch.Tensor:
    """Back to front, the other way round than the kernels: C <- alpha c + (1 - alpha) C."""
    height, width = coverages[0].shape
    solid = scene.canvas.background
    background = torch.zeros(4) if solid is None else torch.tensor([*solid.astype("float64"), 1.0])
    image = background.expand(height, width, 4)
    for shape, cover in enumerate(coverages):
        color, opacity = pixel_paint(scene, p, shape, pixel_centres(width, height) / scale)
        alpha = (p["opacities"][shape] * cover * opacity)[..., None]
        opaque = torch.cat([color, torch.ones_like(color[..., :1])], dim=-1)
        image = alpha * opaque + (1 - alpha) * image
    return image if solid is None else image[..., :3]


def straight(coverages: list[torch.Tensor], p: Tensors, scene: Scene) -> torch.Tensor:
    """Means of colours that are not premultiplied, black where nothing is; of a scene on nothing."""
    image = composite(coverages, p, scene)
    seen = [cover for cover, opacity in zip(coverages, p["opacities"], strict=True) if opacity > SEEN]
    hit = torch.stack(seen).sum(dim=0).clamp(max=1)[..., None]
    return torch.cat([image[..., :3] / image[..., 3:].clamp(min=NOTHING) * hit, image[..., 3:]], dim=-1)
