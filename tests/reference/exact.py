"""Exact coverage: one formula for all edges and pixels."""

from __future__ import annotations

import torch

from tests.reference import stroker
from tests.reference.composite import pixel_centres
from tests.reference.curves import Tensors, points_of
from tests.reference.outline import polyline
from warpsplat.scene import Basis, Cap, Join, Kind, Rule, Scene
from warpsplat.scene.attributes import NO_DASHES


def ramp_integral(u: torch.Tensor) -> torch.Tensor:
    """Antiderivative of clamp(u, 0, 1)."""
    return torch.where(u < 0, torch.zeros_like(u), torch.where(u < 1, u * u / 2, u - 0.5))


Lines = list[torch.Tensor]
"""Vertices of each contour, [vertex, 2]; those of a closed one end where they begin."""


def ends(contours: Lines) -> tuple[torch.Tensor, torch.Tensor]:
    """Both ends of all edges, [edge, 1, 1, 2]."""
    starts, stops = (
        torch.cat(v)[:, None, None] for v in ([c[:-1] for c in contours], [c[1:] for c in contours])
    )
    return starts, stops


def inside(area: torch.Tensor, rule: Rule) -> torch.Tensor:
    """Winding-weighted areas -> coverages: at most 1, or how far from the nearest even number."""
    if rule == Rule.NONZERO:
        return area.abs().clamp(max=1)
    return 1 - (area.abs() % 2 - 1).abs()


def fill_area(contours: Lines, width: int, height: int) -> torch.Tensor:
    """Winding-weighted area of each pixel, [height, width]: over each edge, the integral by y of the part of
    the pixel's row that lies right of the edge. Only rows that an edge reaches are looked at.
    """
    a, b = (end[:, 0, 0] for end in ends([torch.cat([c, c[:1]]) for c in contours]))
    rows = torch.arange(height)
    top, bottom = torch.minimum(a, b)[:, 1:], torch.maximum(a, b)[:, 1:]
    edge, row = torch.nonzero((top <= rows + 1) & (bottom >= rows), as_tuple=True)
    a, b = a[edge][:, None], b[edge][:, None]  # [edge and row, 1, 2]
    x0, y0 = torch.arange(width)[None, :], row[:, None]
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
    return torch.zeros((height, width)).index_add(0, row, share * (yb - ya))


def half_plane(x: torch.Tensor, n: torch.Tensor) -> torch.Tensor:
    """Area of the unit square at 0 where n . p < x: the convolution of two boxes, integrated."""
    wide, narrow = n.abs().max(dim=-1).values, n.abs().min(dim=-1).values.clamp(min=1e-7)

    def ramp2(u: torch.Tensor) -> torch.Tensor:
        return torch.relu(u) ** 2 / 2

    outer, inner = (wide + narrow) / 2, (wide - narrow) / 2
    total = ramp2(x + outer) - ramp2(x + inner) - ramp2(x - inner) + ramp2(x - outer)
    return total / (wide * narrow)


def stroke_coverage(contours: Lines, half: torch.Tensor, width: int, height: int) -> torch.Tensor:
    """Box-filtered band of half-width ``half`` around the nearest segment, [height, width]."""
    centres = pixel_centres(width, height)[None]
    a, b = ends(contours)
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
    """Return each shape's coverage, [height, width]; ``pieces`` of each shape's Béziers."""
    covers = []
    for shape, count in enumerate(pieces):
        basis = Basis(int(scene.basis[shape]))
        points, rest, lines = scale * points_of(scene, p, shape), count, []
        corners = []
        for own, closed in scene.contours_of(shape):
            beziers = len(own) // 3 if basis == Basis.CUBIC else len(own) - 2 * (not closed)
            lines.append(polyline(points[: len(own)], rest[:beziers], closed, basis))
            corners.append([k == 0 for n in rest[:beziers] for k in range(n)])
            points, rest = points[len(own) :], rest[beziers:]
        half = scale * p["widths"][shape] / 2
        if scene.kind[shape] == Kind.FILL:
            covers.append(inside(fill_area(lines, width, height), Rule(int(scene.rule[shape]))))
        elif style := style_of(scene, shape, half, scale):
            closed_ones = [closed for _, closed in scene.contours_of(shape)]
            drawn = [
                torch.stack(polygon)
                for each in zip(lines, corners, closed_ones, strict=True)
                for polygon in stroker.polygons(*each, style)
            ]
            area = fill_area(drawn, width, height) if drawn else torch.zeros((height, width))
            covers.append(inside(area, Rule.NONZERO))
        else:
            covers.append(stroke_coverage(lines, half, width, height))
    return covers


def style_of(scene: Scene, shape: int, half: torch.Tensor, scale: float) -> stroker.Style | None:
    """Return the coverage of a stroke that is not round throughout."""
    cap, join, row = Cap(int(scene.cap[shape])), Join(int(scene.join[shape])), int(scene.dash[shape])
    if cap == Cap.ROUND and join == Join.ROUND and row == NO_DASHES:
        return None
    dashes = () if row == NO_DASHES else tuple(scale * x for x in scene.dashes[row])
    return stroker.Style(half, cap, join, float(scene.miter_limits[shape]), dashes)
