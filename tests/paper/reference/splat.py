"""Gaussians on a grid, and the coverage that they make."""

from __future__ import annotations

import torch

from tests.paper.reference.grid import Plan, differences, grids, runs_of
from tests.reference.curves import Tensors
from warpsplat.paper import constants as k
from warpsplat.scene import Scene


def straightness(x: torch.Tensor) -> torch.Tensor:
    """Squared cosine of the turn along the first axis of [n, m, 2], 0 past a right angle, 1 at the ends."""
    steps = torch.diff(x, dim=0)
    cosine = torch.nn.functional.cosine_similarity(steps[:-1], steps[1:], dim=2).clamp(min=0)
    ones = torch.ones_like(x[:1, :, 0])
    return torch.cat([ones, cosine**2, ones])


def gaussians(
    grid: torch.Tensor,
    detach: bool = False,
    runs: int = 1,
    *,
    least: float = k.PIXEL_SIGMA**2,
    half: torch.Tensor | float = 0.0,
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """(mean [n, 2], scale [n, 2], angle [n]) of grid positions [rows, columns, 2]; all in px.

    ``least``: variance that all have at least; ``half``: scale across that is learnt.
    """
    source = grid.detach() if detach else grid
    stretches = torch.chunk(source.transpose(0, 1), runs)
    dx = torch.cat([differences(x) for x in stretches]).transpose(0, 1)
    dr = differences(source)
    length = dx.norm(dim=2)
    perpendicular = (dx[..., 0] * dr[..., 1] - dx[..., 1] * dr[..., 0]) / length
    straight = torch.cat([straightness(x.detach()) for x in stretches]).transpose(0, 1)
    scale_x = torch.sqrt((k.SPREAD * straight * length) ** 2 + least)
    scale_y = torch.sqrt((k.SPREAD * perpendicular) ** 2 + half**2 + least)
    angle = torch.atan2(dx[..., 1], dx[..., 0])
    return grid.reshape(-1, 2), torch.stack([scale_x, scale_y], 2).reshape(-1, 2), angle.reshape(-1)


def gaussian_values(
    mean: torch.Tensor,
    scale: torch.Tensor,
    angle: torch.Tensor,
    cut: torch.Tensor,
    width: int,
    height: int,
    most: float = k.GAUSSIAN_MAX,
) -> torch.Tensor:
    """g of each Gaussian at each pixel, [n, height, width] (paper eq. 9 to 11), cut and clamped."""
    rotation = torch.stack(
        [torch.stack([angle.cos(), -angle.sin()], 1), torch.stack([angle.sin(), angle.cos()], 1)], 1
    )
    rs = rotation * scale[:, None, :]
    inverse = torch.linalg.inv(rs @ rs.transpose(1, 2))
    (a, b), (c, d) = inverse.permute(1, 2, 0)[..., None, None]
    x = torch.arange(width) + 0.5 - mean[:, 0, None, None]
    y = (torch.arange(height) + 0.5)[:, None] - mean[:, 1, None, None]
    q = a * x * x + (b + c) * x * y + d * y * y
    g = torch.exp(-0.5 * q).clamp(max=most)
    return torch.where(q <= cut[:, None, None], g, torch.zeros_like(g))


def cuts(grid: torch.Tensor) -> torch.Tensor:
    """The q beyond which each Gaussian of a grid is 0, [n]: the outermost rows reach further."""
    cut = torch.full(grid.shape[:2], k.Q_INNER)
    cut[0], cut[-1] = k.Q_MAX, k.Q_MAX
    return cut.reshape(-1)


def coverage(
    grid: torch.Tensor, width: int, height: int, detach: bool = False, runs: int = 1
) -> torch.Tensor:
    """1 - prod (1 - g) over a shape's Gaussians, [height, width]."""
    g = gaussian_values(*gaussians(grid, detach, runs), cuts(grid), width, height)
    return 1 - torch.prod(1 - g, dim=0)


def coverages(
    scene: Scene, p: Tensors, plans: list[Plan], width: int, height: int, scale: float, detach: bool
) -> list[torch.Tensor]:
    """Return coverages of the shapes, [height, width]; ``detach``: no gradient through scales and angles."""
    return [
        coverage(grid, width, height, detach, runs_of(scene, shape))
        for shape, grid in enumerate(grids(scene, p, plans, scale))
    ]
