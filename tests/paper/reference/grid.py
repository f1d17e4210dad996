"""Grids of positions along and across shapes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch

from tests.reference.curves import Tensors, bezier, points_of, tangent
from warpsplat.paper import constants as k
from warpsplat.scene import Kind, Scene


@dataclass
class Plan:
    """Grid of one shape."""

    columns: int
    rows: int
    reach: float


def row_positions(plan: Plan) -> torch.Tensor:
    """u of each row: the normal cumulative distribution at equally spaced places."""
    z = torch.linspace(-plan.reach, plan.reach, plan.rows)
    return torch.special.ndtr(z)


def fill_grid(points: torch.Tensor, plan: Plan) -> torch.Tensor:
    """Grid positions of a fill, [rows, columns, 2] canvas units."""
    n = len(points) // 2
    chain_a = points[: n + 1]
    chain_b = torch.cat([points[:1], points[n:].flip(0)])
    t = (torch.arange(plan.columns) + 0.5) * (n // 3) / plan.columns
    u = row_positions(plan)[:, None, None]
    return (1 - u) * bezier(chain_a, t) + u * bezier(chain_b, t)


def stroke_grid(points: torch.Tensor, width: torch.Tensor, plan: Plan, scale: float) -> torch.Tensor:
    """Grid positions of a stroke, [rows, columns, 2]: segment after segment."""
    n = (len(points) - 1) // 3
    run = plan.columns // n
    caps = max(1, plan.rows // 2)
    body = run - 2 * caps
    radius = max(1 - 2 * k.ROW_INSET / (scale * float(width.detach())), 0.5)
    angles = (torch.arange(caps) + 0.75) / caps * math.pi / 2
    t = torch.cat([torch.zeros(caps), (torch.arange(body) + 0.5) / body, torch.ones(caps)])
    along = torch.cat([-radius * angles.flip(0).sin(), torch.zeros(body), radius * angles.sin()])
    across = torch.cat([angles.flip(0).cos(), torch.ones(body), angles.cos()])
    v = (2 * row_positions(plan) - 1)[:, None, None]
    segments = []
    for i in range(n):
        p = points[3 * i : 3 * i + 4]
        d = tangent(p, t)
        e = d / d.norm(dim=1, keepdim=True)
        normal = torch.stack([-e[:, 1], e[:, 0]], dim=1)
        segments.append(bezier(p, t) + width / 2 * (along[:, None] * e + across[:, None] * v * normal))
    return torch.cat(segments, dim=1)


def differences(x: torch.Tensor) -> torch.Tensor:
    """Central differences along the first axis; at an end the entry stands for its missing neighbour."""
    padded = torch.cat([x[:1], x, x[-1:]])
    return (padded[2:] - padded[:-2]) / 2


def fold_area(grid: torch.Tensor, sign: float) -> torch.Tensor:
    """Area of the grid's cells that are turned round against ``sign`` [px squared]."""
    dx = differences(grid.transpose(0, 1)).transpose(0, 1)
    dr = differences(grid)
    return torch.relu(-sign * (dx[..., 0] * dr[..., 1] - dx[..., 1] * dr[..., 0])).sum()


def runs_of(scene: Scene, shape: int) -> int:
    """Stretches of columns without neighbours in one another: a stroke's segments."""
    return int(scene.point_counts()[shape]) // 3 if scene.kind[shape] == Kind.STROKE else 1


def grids(scene: Scene, p: Tensors, plans: list[Plan], scale: float) -> list[torch.Tensor]:
    """Grid positions [px] of every shape."""
    result = []
    for shape, plan in enumerate(plans):
        points = points_of(scene, p, shape)
        if scene.kind[shape] == Kind.FILL:
            grid = fill_grid(points, plan)
        else:
            grid = stroke_grid(points, p["widths"][shape], plan, scale)
        result.append(scale * grid)
    return result
