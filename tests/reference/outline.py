"""Outlines as polylines."""

from __future__ import annotations

import torch

from tests.reference.curves import bezier, chain
from warpsplat.scene import Basis, Kind


def polyline(points: torch.Tensor, pieces: list[int], kind: Kind, basis: Basis) -> torch.Tensor:
    """Vertices of a flattened shape, ``pieces`` of each Bézier; a fill ends where it begins."""
    steps = [number + torch.arange(n) / n for number, n in enumerate(pieces)]
    return bezier(chain(points, kind, basis), torch.cat([*steps, torch.tensor([float(len(pieces))])]))
