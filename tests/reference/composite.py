"""Coverages -> image."""

from __future__ import annotations

import torch

from tests.reference.curves import Tensors
from warpsplat.scene import Scene


def pixel_centres(width: int, height: int) -> torch.Tensor:
    """[height, width, 2]."""
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    return torch.stack([x, y], dim=2)


def composite(coverages: list[torch.Tensor], p: Tensors, scene: Scene) -> torch.Tensor:
    """Back to front, the other way round than the kernels: C <- alpha c + (1 - alpha) C."""
    background = torch.tensor(scene.canvas.background.astype("float64"))
    image = background.expand(*coverages[0].shape, 3)
    for shape, cover in enumerate(coverages):
        alpha = (p["opacities"][shape] * cover)[..., None]
        image = alpha * p["colors"][shape] + (1 - alpha) * image
    return image
