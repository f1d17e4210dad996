"""Translucent bands as layers: each lies whole on the fainter one around it, so that no gap shows between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Floats, Ints
from warpsplat.drawing.trace.label_map import LabelMap
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.partition import Partition

OPAQUE = 253.0  # [levels] opacity from which on a region is opaque
IMPOSSIBLE = 2.0  # [levels] that no paint makes up for, at the most


@dataclass(frozen=True)
class Nesting:
    """Which regions lie on which."""

    parent: Ints
    """The region that each lies on; NO_REGION for those beside all others. Shape (region,)."""
    depth: Ints
    """How many regions lie below it, shape (region,)."""
    colorings: list[Coloring]
    """Paint that gives each region its look on top of what lies below."""

    def shown(self, depth: int) -> Ints:
        """Return the region that each lies in if none is painted that lies deeper than ``depth``."""
        shown = np.arange(len(self.parent))
        for _ in range(int(self.depth.max()) - depth):
            shown = np.where(self.depth[shown] > depth, self.parent[shown], shown)
        return shown

    def ordered(self, ranks: Ints) -> Ints:
        """Return ranks in the order of painting with each region after the one that it lies on.

        Args:
            ranks: of those that lie on no other, shape (region,); -1 for those that are not painted.
        """
        root = self.shown(0)
        order = np.lexsort((self.depth, ranks[root]))
        order = order[ranks[root[order]] >= 0]
        full = np.full(len(ranks), -1, np.int64)
        full[order] = np.arange(len(order))
        return full


def find_nesting(partition: Partition) -> Nesting:
    """Return which of the translucent bands of smooth shading may lie on one another."""
    count = len(partition.paint)
    own = [partition.colorings[paint] for paint in partition.paint.tolist()]
    parent, depth = np.full(count, NO_REGION, np.int64), np.zeros(count, np.int64)
    bands = [i for i, each in enumerate(own) if each.is_band and not each.is_clear and each.color[3] < OPAQUE]
    colorings = list(own)
    if not bands:
        return Nesting(parent, depth, colorings)
    shared = shared_borders(partition.labels, count)
    known: dict[tuple[int, int], Coloring] = {}
    for band in sorted(bands, key=lambda band: float(own[band].color[3])):
        for below in sorted(bands, key=lambda below: -shared.get((min(band, below), max(band, below)), 0)):
            if (min(band, below), max(band, below)) not in shared:
                break
            key = int(partition.paint[band]), int(partition.paint[below])
            over = known.get(key) or _painted_over(own[band], own[below])
            if over is not None:
                known[key] = colorings[band] = over
                parent[band], depth[band] = below, depth[below] + 1
                break
    return Nesting(parent, depth, colorings)


def shared_borders(labels: LabelMap, count: int) -> dict[tuple[int, int], int]:
    """Return the length of the border of each two regions that have one, the smaller number first."""
    above, before = labels.sides()
    one, other = (np.concatenate(pair).astype(np.int64) for pair in zip(above[2:], before[2:], strict=True))
    low, high = np.minimum(one, other), np.maximum(one, other)
    keys, lengths = np.unique((low * count + high)[low >= 0], return_counts=True)
    pairs = zip((keys // count).tolist(), (keys % count).tolist(), strict=True)
    return dict(zip(pairs, lengths.tolist(), strict=True))


def _painted_over(coloring: Coloring, below: Coloring) -> Coloring | None:
    """Return what looks like ``coloring`` on a flat colour; None if nothing does."""
    if below.ramp is not None or coloring.color[3] <= below.color[3]:
        return None
    ramp = coloring.ramp
    wanted = coloring.color[None] if ramp is None else ramp.colors
    painted = _over(wanted, below.color)
    back = painted + (1 - painted[:, 3:] / 255) * below.color
    if np.abs(back - wanted).max() > IMPOSSIBLE:
        return None
    if ramp is None:
        return Coloring(painted[0], is_band=True)
    return Coloring(painted.mean(axis=0), replace(ramp, colors=painted), is_band=True)


def _over(wanted: Floats, below: Floats) -> Floats:
    """Return the nearest colours that give those wanted on ``below``, premultiplied."""
    opacity = np.clip(255 * (wanted[:, 3:] - below[3]) / (255 - below[3]), 0, 255)
    color = np.clip(wanted[:, :3] - (1 - opacity / 255) * below[:3], 0, opacity)
    return np.concatenate([color, opacity], axis=1)
