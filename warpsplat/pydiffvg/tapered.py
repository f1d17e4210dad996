"""Strokes whose width changes along them, or that a transform stretches, as the areas that they cover.

The boundary is DiffVG's: at right angles to the line, as far from it as the half width there; ends and joins
are round. The contour goes around the line as the convolution with a disc does, so that its winding number is
positive everywhere in the stroke, whatever its bends.
"""

from __future__ import annotations

import torch

Tensor = torch.Tensor

PIECES = 8
"""Cubics along either side of a segment."""
ARCS = 2
"""Cubics of an end or join: two for half a circle leave the radius right to 3e-4."""


def contour_sizes(segments: int, is_closed: bool) -> list[int]:
    """Return the number of points of each contour around a stroke of so many segments."""
    side = 3 * (PIECES + ARCS) * segments
    return [side, side] if is_closed else [2 * side]


def contours_around(segments: Tensor, radii: Tensor, is_closed: bool) -> Tensor:
    """Return the control points of the contours around strokes, shape (stroke, point, 2).

    ``segments``: control points of cubics, shape (stroke, segment, 4, 2); ``radii``: half widths as a cubic's
    control values, shape (stroke, segment, 4); ``is_closed``: whether the last segment ends at the first.
    """
    center, normal, radius = _samples(segments, radii)
    left = _cubics(center + radius * normal)
    right = _cubics((center - radius * normal).flip(2))
    following = torch.arange(1, segments.shape[1] + 1) % segments.shape[1]
    arriving, leaving = normal[:, :, -1], normal[:, following, 0]
    joint = center[:, :, -1], radius[:, :, -1]
    outer = _arc(*joint, arriving, _angle(arriving, leaving))
    inner = _arc(*joint, -leaving, _angle(-leaving, -arriving))
    forth = torch.cat([left, outer], dim=2).flatten(1, 2)
    back = torch.cat([inner, right], dim=2).flip(1).flatten(1, 2)
    if is_closed:
        return torch.cat([forth, back], dim=1)
    half = torch.full_like(segments[:, 0, 0, 0], -torch.pi)
    end = _arc(center[:, -1, -1], radius[:, -1, -1], normal[:, -1, -1], half)
    start = _arc(center[:, 0, 0], radius[:, 0, 0], -normal[:, 0, 0], half)
    join = 3 * ARCS  # between the last segment and the first
    return torch.cat([forth[:, :-join], end, back[:, join:], start], dim=1)


def _samples(segments: Tensor, radii: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return points, unit normals and half widths at the ends of the pieces.

    Shape (stroke, segment, sample, 2); that of half widths (stroke, segment, sample, 1).
    """
    t = torch.linspace(0, 1, PIECES + 1, device=segments.device)
    s = 1 - t
    weights = torch.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], dim=1)
    slopes = torch.stack([s * s, 2 * s * t, t * t], dim=1)
    center = torch.einsum("tk,bskc->bstc", weights, segments)
    along = torch.einsum("tk,bskc->bstc", slopes, segments.diff(dim=2))
    # Where handles lie on their ends the derivative has no direction; the nearest chord then gives it.
    chord = torch.cat([center[:, :, 1:2] - center[:, :, :1], center.diff(dim=2)], dim=2)
    small = 1e-6  # length of a derivative below which it has no direction
    along = torch.where(along.norm(dim=-1, keepdim=True) > small, along, chord)
    size = along.square().sum(dim=-1, keepdim=True)
    unit = along * (size + small**2).rsqrt()
    normal = torch.stack([-unit[..., 1], unit[..., 0]], dim=-1)
    return center, normal, torch.einsum("tk,bsk->bst", weights, radii)[..., None]


def _cubics(side: Tensor) -> Tensor:
    """Return cubics through samples without their last point, shape (stroke, segment, 3 x piece, 2)."""
    inner = (side[:, :, 2:] - side[:, :, :-2]) / 2
    first = (4 * side[:, :, 1] - 3 * side[:, :, 0] - side[:, :, 2]) / 2
    last = (3 * side[:, :, -1] - 4 * side[:, :, -2] + side[:, :, -3]) / 2
    third = torch.cat([first[:, :, None], inner, last[:, :, None]], dim=2) / 3
    points = [side[:, :, :-1], side[:, :, :-1] + third[:, :, :-1], side[:, :, 1:] - third[:, :, 1:]]
    return torch.stack(points, dim=3).flatten(2, 3)


def _angle(start: Tensor, end: Tensor) -> Tensor:
    """Return the signed angle between unit vectors, shape (...,)."""
    cross = start[..., 0] * end[..., 1] - start[..., 1] * end[..., 0]
    return torch.atan2(cross, (start * end).sum(dim=-1))


def _arc(center: Tensor, radius: Tensor, start: Tensor, turn: Tensor) -> Tensor:
    """Return the cubics of arcs without their last point, shape (..., 3 x ARCS, 2).

    ``center``: shape (..., 2); ``radius``: shape (..., 1); ``start``: unit vector to the first point, shape
    (..., 2); ``turn``: signed angle, shape (...,).
    """
    angle = turn[..., None] * (torch.arange(ARCS + 1, device=start.device) / ARCS)
    across = torch.stack([-start[..., 1], start[..., 0]], dim=-1)[..., None, :]
    unit = angle.cos()[..., None] * start[..., None, :] + angle.sin()[..., None] * across
    ahead = angle.cos()[..., None] * across - angle.sin()[..., None] * start[..., None, :]
    reach = (4 / 3 * torch.tan(turn / (4 * ARCS)))[..., None, None]
    points = [unit[..., :-1, :], unit[..., :-1, :] + reach * ahead[..., :-1, :]]
    points.append(unit[..., 1:, :] - reach * ahead[..., 1:, :])
    shape = torch.stack(points, dim=-2).flatten(-3, -2)
    return center[..., None, :] + radius[..., None, :] * shape
