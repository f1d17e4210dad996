"""Strokes whose width changes along them, or that a map stretches, as the areas that they cover.

The boundary is that of DiffVG: at right angles to the line, as far from it as the width there says; the ends
and the joints of segments are round. It is traced around the line as the convolution with a disc is, so that
its winding number is positive throughout the stroke, whatever its bends.
"""

from __future__ import annotations

import torch

Tensor = torch.Tensor

PIECES = 8
"""Cubics along either side of a segment."""
ARCS = 2
"""Cubics of an end or joint: with half a circle in two, the radius is right to 3e-4."""
SMALL = 1e-6
"""Length of a derivative below which it has no direction."""


def ring_points(segments: Tensor, radii: Tensor | None, is_closed: bool) -> list[Tensor]:
    """Control points of the closed contours around strokes.

    Args:
        segments: control points of cubics, shape (stroke, segment, 4, 2).
        radii: half widths as a cubic's control values, shape (stroke, segment, 4); None: none.
        is_closed: whether the last segment ends at the first.

    Returns:
        of each contour, one for an open line and two for a closed one, shape (point, stroke, 2).
    """
    if radii is None:
        radii = torch.zeros(segments.shape[:-1])
    center, normal, reach = _samples(segments, radii)
    sides = [center + sign * reach * normal for sign in (1.0, -1.0)]
    left, right = (_cubics(side) for side in (sides[0], sides[1].flip(2)))
    at = center[:, :, -1], reach[:, :, -1]
    count = segments.shape[1]
    following = torch.arange(1, count + 1) % count
    arriving, leaving = normal[:, :, -1], normal[:, following, 0]
    outer = _arc(*at, arriving, leaving)
    inner = _arc(*at, -leaving, -arriving)
    if is_closed:
        forth = torch.cat([left, outer], dim=2).flatten(1, 2)
        back = torch.cat([inner, right], dim=2).flip(1).flatten(1, 2)
        return [forth.transpose(0, 1), back.transpose(0, 1)]
    end = _arc(at[0][:, -1], at[1][:, -1], arriving[:, -1], -arriving[:, -1], half=True)
    start = _arc(center[:, 0, 0], reach[:, 0, 0], -normal[:, 0, 0], normal[:, 0, 0], half=True)
    parts = []
    for i in range(count):
        parts += [left[:, i]] + ([outer[:, i]] if i + 1 < count else [])
    parts.append(end)
    for i in reversed(range(count)):
        parts += ([inner[:, i]] if i + 1 < count else []) + [right[:, i]]
    parts.append(start)
    return [torch.cat(parts, dim=1).transpose(0, 1)]


def _samples(segments: Tensor, radii: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Points, unit normals and half widths at the ends of the pieces, shape (stroke, segment, sample, 2), and
    (stroke, segment, sample, 1).
    """
    t = torch.linspace(0, 1, PIECES + 1, device=segments.device)
    s = 1 - t
    weights = torch.stack([s**3, 3 * s * s * t, 3 * s * t * t, t**3], dim=1)
    slopes = torch.stack([s * s, 2 * s * t, t * t], dim=1)
    center = torch.einsum("tk,bskc->bstc", weights, segments)
    along = torch.einsum("tk,bskc->bstc", slopes, segments.diff(dim=2))
    # Where handles lie on their ends the derivative has no direction; then the nearest chord's counts.
    chord = torch.cat([center[:, :, 1:2] - center[:, :, :1], center.diff(dim=2)], dim=2)
    along = torch.where(along.norm(dim=-1, keepdim=True) > SMALL, along, chord)
    size = along.square().sum(dim=-1, keepdim=True)
    unit = along * (size + SMALL**2).rsqrt()
    normal = torch.stack([-unit[..., 1], unit[..., 0]], dim=-1)
    return center, normal, torch.einsum("tk,bsk->bst", weights, radii)[..., None]


def _cubics(side: Tensor) -> Tensor:
    """A curve through samples, without its last point: shape (stroke, segment, 3 x piece, 2)."""
    inner = (side[:, :, 2:] - side[:, :, :-2]) / 2
    first = (4 * side[:, :, 1] - 3 * side[:, :, 0] - side[:, :, 2]) / 2
    last = (3 * side[:, :, -1] - 4 * side[:, :, -2] + side[:, :, -3]) / 2
    third = torch.cat([first[:, :, None], inner, last[:, :, None]], dim=2) / 3
    points = [side[:, :, :-1], side[:, :, :-1] + third[:, :, :-1], side[:, :, 1:] - third[:, :, 1:]]
    return torch.stack(points, dim=3).flatten(2, 3)


def _arc(center: Tensor, radius: Tensor, start: Tensor, end: Tensor, *, half: bool = False) -> Tensor:
    """From one unit vector about ``center`` to another, by the shorter way or, if ``half``, by half a turn
    from the normal over the direction; without its last point: shape (..., 3 x ARCS, 2).
    """
    cross = start[..., 0] * end[..., 1] - start[..., 1] * end[..., 0]
    dot = (start * end).sum(dim=-1)
    turn = -torch.pi * torch.ones_like(dot) if half else torch.atan2(cross, dot)
    steps = torch.arange(ARCS + 1, device=start.device) / ARCS
    angle = turn[..., None] * steps
    across = torch.stack([-start[..., 1], start[..., 0]], dim=-1)[..., None, :]
    unit = angle.cos()[..., None] * start[..., None, :] + angle.sin()[..., None] * across
    ahead = angle.cos()[..., None] * across - angle.sin()[..., None] * start[..., None, :]
    reach = (4 / 3 * torch.tan(turn / (4 * ARCS)))[..., None, None]
    points = [unit[..., :-1, :], unit[..., :-1, :] + reach * ahead[..., :-1, :]]
    points.append(unit[..., 1:, :] - reach * ahead[..., 1:, :])
    shape = torch.stack(points, dim=-2).flatten(-3, -2)
    return center[..., None, :] + radius[..., None, :] * shape
