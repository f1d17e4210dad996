"""Pruning: shapes that show next to nothing are removed, as others are worth more (paper section 3.4)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.fit.schedule import opacity_threshold
from warpsplat.fit.settings import Density
from warpsplat.scene import FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import areas, bounds

BoolArray = npt.NDArray[np.bool_]

PAIRS_PER_CHUNK = 1 << 18
"""Pairs of shapes that ``duplicates`` compares at once, to bound its memory."""


def prune_mask(scene: Scene, density: Density, progress: float) -> BoolArray:
    """Return which shapes are faint, tiny, not finite or duplicates, at ``progress`` (share of the run)."""
    pruned = scene.opacities + scene.fades.mean(axis=1) < opacity_threshold(density, progress)
    # Many shapes on a small canvas have to be tiny.
    share = scene.canvas.width * scene.canvas.height / max(len(scene), 1)
    pruned |= areas(scene) < min(density.area, 0.1 * share)
    broken = ~np.isfinite(scene.points).all(axis=1)
    pruned |= np.logical_or.reduceat(broken, scene.first[:-1]) if len(scene) else pruned
    return pruned | duplicates(scene, density)


def duplicates(scene: Scene, density: Density) -> BoolArray:
    """Return which shapes have nearly the colour and the bounding box of a shape in front of them."""
    boxes = bounds(scene)
    # Boxes that overlap enough have nearly the same left edge: a window over the sorted edges is enough.
    order = np.argsort(boxes[:, 0], kind="stable")
    left = boxes[order, 0]
    slack = (1 - density.duplicate_overlap) * (boxes[:, 2] - boxes[:, 0])
    first = np.searchsorted(left, boxes[:, 0])
    counts = np.searchsorted(left, boxes[:, 0] + slack, "right") - first
    ends = np.cumsum(counts)
    found = np.zeros(len(scene), np.bool_)
    total = int(counts.sum())
    for start in range(0, total, PAIRS_PER_CHUNK):
        pair = np.arange(start, min(start + PAIRS_PER_CHUNK, total))
        i = np.searchsorted(ends, pair, "right")
        j = order[first[i] + pair - (ends - counts)[i]]
        similar = (i != j) & _are_similar(boxes, scene.colors, density, i, j)
        found[np.minimum(i, j)[similar]] = True
    return found


def _are_similar(
    boxes: FloatArray, colors: FloatArray, density: Density, i: IndexArray, j: IndexArray
) -> BoolArray:
    """Return which pairs of shapes have nearly the same box and colour."""
    sizes = np.maximum(1e-6, (boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    low, high = np.maximum(boxes[i, :2], boxes[j, :2]), np.minimum(boxes[i, 2:], boxes[j, 2:])
    common = np.clip(high - low, 0, None).prod(axis=1)
    overlap = common / (sizes[i] + sizes[j] - common)
    distance = np.linalg.norm(colors[j] - colors[i], axis=1)
    return np.asarray((overlap > density.duplicate_overlap) & (distance < density.duplicate_color))


def choose_removed(pruned: BoolArray, count: int, costs: FloatArray) -> IndexArray:
    """Return ``count`` shapes to remove: all ``pruned`` ones, then those with the least removal ``costs``."""
    rank = np.lexsort((costs, ~pruned))
    return np.asarray(rank[: max(count, int(pruned.sum()))])
