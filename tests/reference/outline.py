"""Outlines as polylines that lie on either side of their curves."""

from __future__ import annotations

import torch

from tests.reference.curves import chain
from warpsplat.scene import Basis


def polyline(points: torch.Tensor, pieces: list[int], ring: bool, basis: Basis) -> torch.Tensor:
    """Vertices of a flattened contour, ``pieces`` of each Bézier; a ring ends where it begins."""
    path = chain(points, ring, basis)
    sides = [shifted(path[3 * i : 3 * i + 4], n) for i, n in enumerate(pieces)]
    joints = [(a[-1:] + b[:1]) / 2 for a, b in zip([sides[-1], *sides], sides, strict=False)]
    if not ring:
        joints[0] = path[:1]
    within = [torch.cat([joint, side[1:-1]]) for joint, side in zip(joints, sides, strict=True)]
    return torch.cat([*within, joints[0] if ring else path[-1:]])


def shifted(cubic: torch.Tensor, n: int) -> torch.Tensor:
    """Points of a cubic [4, 2] at k / n, each moved by a twelfth of its second difference; [n + 1, 2]."""
    step = 1 / n
    t = torch.linspace(0, 1, n + 1, dtype=cubic.dtype)
    # A cubic is defined beyond its ends too, and its second difference is exactly h^2 B''.
    around = [polynomial(cubic, t + side * step) for side in (-1, 0, 1)]
    return around[1] - (around[0] - 2 * around[1] + around[2]) / 12


def polynomial(cubic: torch.Tensor, t: torch.Tensor) -> torch.Tensor:
    """A cubic at any t [m], by its Bernstein form; [m, 2]."""
    t = t[:, None]
    a, b, c, d = cubic
    return (1 - t) ** 3 * a + 3 * (1 - t) ** 2 * t * b + 3 * (1 - t) * t**2 * c + t**3 * d
