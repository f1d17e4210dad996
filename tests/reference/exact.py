"""Exact coverage: one formula for all edges and pixels."""

from __future__ import annotations

import torch

from tests.reference.composite import pixel_centres
from tests.reference.curves import Tensors, points_of
from tests.reference.outline import polyline
from warpsplat.scene import Basis, Kind, Scene


def ramp_integral(u: torch.Tensor) -> torch.Tensor:
    """Antiderivative of clamp(u, 0, 1)."""
    return torch.where(u < 0, torch.zeros_like(u), torch.where(u < 1, u * u / 2, u - 0.5))


def fill_coverage(vertices: torch.Tensor, width: int, height: int) -> torch.Tensor:
    """|winding-weighted area| of each pixel, at most 1, [height, width]: over each edge, the integral by y
    of the part of the pixel's row that lies right of the edge.
    """
    a, b = vertices[:-1, None, None], vertices[1:, None, None]
    x0, y0 = torch.arange(width)[None, None, :], torch.arange(height)[None, :, None]
    slope = (b[..., 0] - a[..., 0]) / torch.where(
        b[..., 1] == a[..., 1], torch.ones(()), b[..., 1] - a[..., 1]
    )
    ya = torch.minimum(torch.maximum(a[..., 1], y0), y0 + 1.0)
    yb = torch.minimum(torch.maximum(b[..., 1], y0), y0 + 1.0)
    ua = x0 + 1 - (a[..., 0] + slope * (ya - a[..., 1]))
    ub = x0 + 1 - (a[..., 0] + slope * (yb - a[..., 1]))
    steep = (ub - ua).abs() < 1e-9
    rise = torch.where(steep, torch.ones(()), ub - ua)
    sloped = (ramp_integral(ub) - ramp_integral(ua)) / rise
    share = torch.where(steep, ((ua + ub) / 2).clamp(0, 1), sloped)
    return (share * (yb - ya)).sum(0).abs().clamp(max=1)


def half_plane(x: torch.Tensor, n: torch.Tensor) -> torch.Tensor:
    """Area of the unit square at 0 where n . p < x: the convolution of two boxes, integrated."""
    wide, narrow = n.abs().max(dim=-1).values, n.abs().min(dim=-1).values.clamp(min=1e-7)

    def ramp2(u: torch.Tensor) -> torch.Tensor:
        return torch.relu(u) ** 2 / 2

    outer, inner = (wide + narrow) / 2, (wide - narrow) / 2
    total = ramp2(x + outer) - ramp2(x + inner) - ramp2(x - inner) + ramp2(x - outer)
    return total / (wide * narrow)


def stroke_coverage(vertices: torch.Tensor, half: torch.Tensor, width: int, height: int) -> torch.Tensor:
    """Box-filtered band of half-width ``half`` around the nearest segment, [height, width]."""
    centres = pixel_centres(width, height)[None]
    a, b = vertices[:-1, None, None], vertices[1:, None, None]
    e = b - a
    t = (((centres - a) * e).sum(-1) / (e * e).sum(-1).clamp(min=1e-12)).clamp(0, 1)[..., None]
    r = centres - a - t * e
    d = r.norm(dim=-1)
    nearest = d.argmin(dim=0, keepdim=True)
    d = d.gather(0, nearest)[0]
    n = r.detach().gather(0, nearest[..., None].expand(-1, -1, -1, 2))[0]
    n = n / n.norm(dim=-1, keepdim=True).clamp(min=1e-9)
    return half_plane(half - d, n) + half_plane(half + d, n) - 1


def coverages(
    scene: Scene, p: Tensors, pieces: list[list[int]], width: int, height: int, scale: float
) -> list[torch.Tensor]:
    """Of each shape, [height, width]; ``pieces`` of each shape's Béziers."""
    covers = []
    for shape, count in enumerate(pieces):
        kind = Kind(int(scene.kind[shape]))
        basis = Basis(int(scene.basis[shape]))
        vertices = polyline(scale * points_of(scene, p, shape), count, kind, basis)
        if kind == Kind.FILL:
            covers.append(fill_coverage(vertices, width, height))
        else:
            covers.append(stroke_coverage(vertices, scale * p["widths"][shape] / 2, width, height))
    return covers
