"""Outlines as polylines."""

from __future__ import annotations

import torch

from tests.reference.curves import bezier
from warpsplat.scene import Kind


def polyline(points: torch.Tensor, pieces: list[int], kind: Kind) -> torch.Tensor:
    """Vertices of a flattened shape, ``pieces`` of each cubic; a fill ends where it begins."""
    chain = torch.cat([points, points[:1]]) if kind == Kind.FILL else points
    steps = [cubic + torch.arange(n) / n for cubic, n in enumerate(pieces)]
    return bezier(chain, torch.cat([*steps, torch.tensor([float(len(pieces))])]))
