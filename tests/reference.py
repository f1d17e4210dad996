"""The renderer again: plain, slow, float64, one formula after the other; gradients by torch autograd.

It shares the constants and the grid plan (rows, columns, reach: integers and detached) with the kernels,
and nothing else. Image sizes of a few dozen pixels.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import torch

from warpsplat.kernels import constants as k
from warpsplat.scene import Scene

torch.set_default_dtype(torch.float64)


@dataclass
class Plan:
    """Grid of one part."""

    columns: int
    rows: int
    reach: float


def tensors(scene: Scene) -> dict[str, torch.Tensor]:
    """The scene's parameters as leaves that require gradients."""
    names = ("points", "colors", "opacities", "widths")
    return {
        name: torch.tensor(getattr(scene, name), dtype=torch.float64, requires_grad=True) for name in names
    }


def bezier(p: torch.Tensor, t: torch.Tensor) -> torch.Tensor:
    """Chain of cubics: p [3 n + 1, 2], t [m] in [0, n] -> [m, 2], by de Casteljau."""
    n = (len(p) - 1) // 3
    segment = torch.clamp(t.floor().long(), 0, n - 1)
    s = (t - segment)[:, None]
    q = [p[3 * segment + j] for j in range(4)]
    while len(q) > 1:
        q = [(1 - s) * a + s * b for a, b in itertools.pairwise(q)]
    return q[0]


def tangent(p: torch.Tensor, t: torch.Tensor) -> torch.Tensor:
    """Derivative of ``bezier`` by t, from differences of control points."""
    n = (len(p) - 1) // 3
    segment = torch.clamp(t.floor().long(), 0, n - 1)
    s = (t - segment)[:, None]
    d = [3 * (p[3 * segment + j + 1] - p[3 * segment + j]) for j in range(3)]
    return (1 - s) ** 2 * d[0] + 2 * s * (1 - s) * d[1] + s**2 * d[2]


def row_positions(plan: Plan) -> torch.Tensor:
    """u of each row: the normal cumulative distribution at equally spaced places."""
    z = torch.linspace(-plan.reach, plan.reach, plan.rows)
    return torch.special.ndtr(z)


def closed_grid(points: torch.Tensor, plan: Plan) -> torch.Tensor:
    """Grid positions of a closed curve, [rows, columns, 2] canvas units."""
    n = len(points) // 2
    chain_a = points[: n + 1]
    chain_b = torch.cat([points[:1], points[n:].flip(0)])
    t = (torch.arange(plan.columns) + 0.5) * (n // 3) / plan.columns
    u = row_positions(plan)[:, None, None]
    return (1 - u) * bezier(chain_a, t) + u * bezier(chain_b, t)


def open_grid(points: torch.Tensor, width: torch.Tensor, plan: Plan, scale: float) -> torch.Tensor:
    """Grid positions of a stroke or of one of its segments, [rows, columns, 2]: segment after segment."""
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


def straightness(x: torch.Tensor) -> torch.Tensor:
    """Squared cosine of the turn along the first axis of [n, m, 2], 0 past a right angle, 1 at the ends."""
    steps = torch.diff(x, dim=0)
    cosine = torch.nn.functional.cosine_similarity(steps[:-1], steps[1:], dim=2).clamp(min=0)
    ones = torch.ones_like(x[:1, :, 0])
    return torch.cat([ones, cosine**2, ones])


def gaussians(
    grid: torch.Tensor, detach: bool = False, runs: int = 1
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """(mean [n, 2], scale [n, 2], angle [n]) of grid positions [rows, columns, 2] in px."""
    source = grid.detach() if detach else grid
    stretches = torch.chunk(source.transpose(0, 1), runs)
    dx = torch.cat([differences(x) for x in stretches]).transpose(0, 1)
    dr = differences(source)
    length = dx.norm(dim=2)
    perpendicular = (dx[..., 0] * dr[..., 1] - dx[..., 1] * dr[..., 0]) / length
    straight = torch.cat([straightness(x.detach()) for x in stretches]).transpose(0, 1)
    scale_x = torch.sqrt((k.SPREAD * straight * length) ** 2 + k.PIXEL_SIGMA**2)
    scale_y = torch.sqrt((k.SPREAD * perpendicular) ** 2 + k.PIXEL_SIGMA**2)
    angle = torch.atan2(dx[..., 1], dx[..., 0])
    return grid.reshape(-1, 2), torch.stack([scale_x, scale_y], 2).reshape(-1, 2), angle.reshape(-1)


def fold_area(grid: torch.Tensor, sign: float) -> torch.Tensor:
    """Area of the grid's cells that are turned round against ``sign`` [px squared]."""
    dx = differences(grid.transpose(0, 1)).transpose(0, 1)
    dr = differences(grid)
    return torch.relu(-sign * (dx[..., 0] * dr[..., 1] - dx[..., 1] * dr[..., 0])).sum()


def pixel_centres(width: int, height: int) -> torch.Tensor:
    """[height, width, 2]."""
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    return torch.stack([x, y], dim=2)


def gaussian_values(
    mean: torch.Tensor, scale: torch.Tensor, angle: torch.Tensor, cut: torch.Tensor, width: int, height: int
) -> torch.Tensor:
    """g of each Gaussian at each pixel, [n, height, width] (paper eq. 9 to 11), cut and clamped."""
    rotation = torch.stack(
        [torch.stack([angle.cos(), -angle.sin()], 1), torch.stack([angle.sin(), angle.cos()], 1)], 1
    )
    rs = rotation * scale[:, None, :]
    inverse = torch.linalg.inv(rs @ rs.transpose(1, 2))
    d = pixel_centres(width, height)[None] - mean[:, None, None, :]
    q = torch.einsum("nhwi,nij,nhwj->nhw", d, inverse, d)
    g = torch.exp(-0.5 * q).clamp(max=k.GAUSSIAN_MAX)
    return torch.where(q <= cut[:, None, None], g, torch.zeros_like(g))


def cuts(grid: torch.Tensor) -> torch.Tensor:
    """The q beyond which each Gaussian of a grid is 0, [n]: the outermost rows reach further."""
    cut = torch.full(grid.shape[:2], k.Q_INNER)
    cut[0], cut[-1] = k.Q_MAX, k.Q_MAX
    return cut.reshape(-1)


def coverage(
    grid: torch.Tensor, width: int, height: int, detach: bool = False, runs: int = 1
) -> torch.Tensor:
    """1 - prod (1 - g) over a part's Gaussians, [height, width]."""
    g = gaussian_values(*gaussians(grid, detach, runs), cuts(grid), width, height)
    return 1 - torch.prod(1 - g, dim=0)


def composite(
    coverages: list[torch.Tensor], colors: torch.Tensor, opacities: torch.Tensor, background: torch.Tensor
) -> torch.Tensor:
    """Back to front, the other way round than the kernels: C <- alpha c + (1 - alpha) C."""
    image = background.expand(*coverages[0].shape, 3)
    for i, cover in enumerate(coverages):
        alpha = (opacities.reshape(-1)[i] * cover)[..., None]
        image = alpha * colors[i // opacities.shape[1]] + (1 - alpha) * image
    return image


def grids(scene: Scene, p: dict[str, torch.Tensor], plans: list[Plan], scale: float) -> list[torch.Tensor]:
    """Grid positions [px] of every part."""
    result = []
    opacity_count = scene.opacities.shape[1]
    for i, plan in enumerate(plans):
        curve, j = divmod(i, opacity_count)
        points = p["points"][curve]
        if scene.kind == "closed":
            grid = closed_grid(points, plan)
        else:
            n = (len(points) - 1) // opacity_count
            grid = open_grid(points[n * j : n * (j + 1) + 1], p["widths"][curve], plan, scale)
        result.append(scale * grid)
    return result


def render(
    scene: Scene,
    p: dict[str, torch.Tensor],
    plans: list[Plan],
    width: int,
    height: int,
    scale: float = 1.0,
    detach: bool = False,
) -> torch.Tensor:
    """The image, [height, width, 3]."""
    runs = (scene.points.shape[1] - 1) // 3 // scene.opacities.shape[1] if scene.kind == "open" else 1
    covers = [coverage(grid, width, height, detach, runs) for grid in grids(scene, p, plans, scale)]
    background = torch.tensor(np.asarray(scene.background, np.float64))
    return composite(covers, p["colors"], p["opacities"], background)


def xing(scene: Scene, points: torch.Tensor) -> torch.Tensor:
    """Xing loss of LIVE: mean over all cubics of the scene."""
    closed = scene.kind == "closed"
    count = points.shape[1] // 3
    padded = torch.cat([points, points[:, :1]], dim=1) if closed else points
    total = torch.zeros(())
    for curve in padded:
        for segment in range(count):
            edges = torch.diff(curve[3 * segment : 3 * segment + 4], dim=0)

            def sine(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
                return (a[0] * b[1] - a[1] * b[0]) / (a.norm() * b.norm())

            s12, s13 = sine(edges[0], edges[1]), sine(edges[0], edges[2])
            total = total + (torch.relu(-s13) if s12 >= 0 else torch.relu(s13))
    return total / (len(points) * count)


def ssim(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """SSIM of one window (Wang et al. 2004, eq. 13), x and y [pixel, channel] -> [channel]."""
    mx, my = x.mean(0), y.mean(0)
    vx, vy = ((x - mx) ** 2).mean(0), ((y - my) ** 2).mean(0)
    covariance = ((x - mx) * (y - my)).mean(0)
    c1, c2 = 0.01**2, 0.03**2
    return (2 * mx * my + c1) * (2 * covariance + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2))
