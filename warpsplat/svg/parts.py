"""Shapes of very many nodes as several paths: beyond some number editors slow down and plotters refuse."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from warpsplat.scene import Basis, FloatArray, IndexArray, Scene
from warpsplat.scene.scene import ranges, starts_of

MOST_NODES = 32_000
"""Of a path."""

MARGIN = 1.0
"""Contours nearer to each other than this [px] stay in one path: there the edges of both are seen."""


def in_parts(scene: Scene, most: int = MOST_NODES) -> Scene:
    """``scene`` with shapes of more than ``most`` nodes as several that show the same.

    Contours stay together whose boxes meet, as one may be a hole of the other, or both may be translucent: a
    shape whose contours all meet stays whole. So does one that is filled and stroked.
    """
    contours = np.searchsorted(scene.starts, scene.first).astype(np.intp)
    nodes = _nodes(scene)
    total = np.add.reduceat(np.append(nodes, 0), contours[:-1]) if len(scene) else nodes
    has_twin = np.append(scene.twin[1:], 0).astype(np.bool_) | scene.twin.astype(np.bool_)
    large = (total > most) & (np.diff(contours) > 1) & ~has_twin
    if not large.any():
        return scene
    parts: list[list[IndexArray]] = [[np.arange(low, high)] for low, high in itertools.pairwise(contours)]
    boxes = _boxes(scene)
    for shape in np.flatnonzero(large).tolist():
        own = parts[shape][0]
        pad = 0.5 * (MARGIN + float(scene.widths[shape]))
        parts[shape] = [own[part] for part in _packed(_clusters(boxes[own], pad), nodes[own], most)]
    return _with_parts(scene, parts)


def _nodes(scene: Scene) -> IndexArray:
    """Nodes of each contour: where its segments begin and end."""
    points = np.diff(scene.starts)
    shape = np.searchsorted(scene.first, scene.starts[:-1], "right") - 1
    return np.where(scene.basis[shape] == Basis.CUBIC, -(-points // 3), points).astype(np.intp)


def _boxes(scene: Scene) -> FloatArray:
    """Of the control points of each contour, shape (contour, 4)."""
    low = np.minimum.reduceat(scene.points, scene.starts[:-1], axis=0)
    high = np.maximum.reduceat(scene.points, scene.starts[:-1], axis=0)
    return np.concatenate([low, high], axis=1)


def _clusters(boxes: FloatArray, pad: float) -> list[list[int]]:
    """Contours that stay together, in the order of their first ones.

    Args:
        boxes: of the contours, shape (contour, 4).
        pad: what each box grows by.
    """
    low, high = boxes[:, :2] - pad, boxes[:, 2:] + pad
    owner = np.arange(len(boxes))
    for i in range(1, len(boxes)):
        met = ((low[:i] < high[i]) & (low[i] < high[:i])).all(axis=1)
        if met.any():
            names = np.append(np.unique(owner[:i][met]), i)
            owner[np.isin(owner, names)] = names.min()
    return [np.flatnonzero(owner == name).tolist() for name in np.unique(owner)]


def _packed(clusters: list[list[int]], nodes: IndexArray, most: int) -> list[list[int]]:
    """Clusters put together, one after another, as far as ``most`` nodes allow."""
    parts: list[list[int]] = []
    room = 0
    for cluster in clusters:
        need = int(nodes[cluster].sum())
        if not parts or need > room:
            parts.append([])
            room = most
        parts[-1] += cluster
        room -= need
    return parts


def _with_parts(scene: Scene, parts: list[list[IndexArray]]) -> Scene:
    """``scene`` with shapes of these contours, by shape."""
    made = scene.take(np.repeat(np.arange(len(scene)), [len(own) for own in parts]))
    order = [part for own in parts for part in own]
    contours = np.concatenate(order)
    counts = np.diff(scene.starts)[contours]
    starts = starts_of(counts)
    return replace(
        made,
        points=scene.points[ranges(scene.starts[contours], counts)],
        starts=starts,
        closed=scene.closed[contours],
        first=starts[starts_of(np.array([len(part) for part in order]))],
    )
