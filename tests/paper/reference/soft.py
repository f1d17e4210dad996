"""The paper's own soft model: Gaussians of their own strengths on grids and rows."""

from __future__ import annotations

import torch

from tests.paper.reference.grid import Plan, fill_grid
from tests.paper.reference.splat import gaussian_values, gaussians
from tests.reference.curves import Tensors, bezier, points_of
from warpsplat.paper import constants as k
from warpsplat.scene import Kind, Scene


def stroke_row(points: torch.Tensor, stations: int) -> torch.Tensor:
    """Positions along a stroke, [1, stations, 2] canvas units."""
    cubics = (len(points) - 1) // 3
    t = (torch.arange(stations) + 0.5) * cubics / stations
    return bezier(points, t)[None]


def strengths(p: Tensors, shape: int, plan: Plan) -> torch.Tensor:
    """Peak of each Gaussian of a shape, [rows * stations]."""
    thirds = (torch.arange(plan.columns) * 3 // plan.columns).repeat(plan.rows)
    return k.GAUSSIAN_MAX * (p["opacities"][shape] + p["fades"][shape][thirds]).clamp(0, 1)


def coverages(
    scene: Scene,
    p: Tensors,
    plans: list[Plan],
    width: int,
    height: int,
    scale: float,
    *,
    softness: float,
    detach: bool,
) -> list[torch.Tensor]:
    """Return each shape's coverage, opacities included, [height, width]."""
    covers = []
    for shape, plan in enumerate(plans):
        points = points_of(scene, p, shape)
        fill = scene.kind[shape] == Kind.FILL
        grid = scale * (fill_grid(points, plan) if fill else stroke_row(points, plan.columns))
        least = (scale * softness) ** 2 + k.PIXEL_VARIANCE
        made = gaussians(grid, detach, least=least, half=k.WIDTH_SIGMA * scale * p["widths"][shape])
        cut = torch.full((plan.rows * plan.columns,), k.Q_SOFT)
        g = gaussian_values(*made, cut, width, height, most=1.0)
        covers.append(1 - torch.prod(1 - strengths(p, shape, plan)[:, None, None] * g, dim=0))
    return covers
