"""Shapes with very many nodes as several paths: editors slow down and plotters refuse."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from warpsplat.scene import Basis, FloatArray, IndexArray, Scene
from warpsplat.scene.scene import ranges, starts_of

MOST_NODES = 32_000
"""Most nodes of a path."""


def in_parts(scene: Scene, most: int = MOST_NODES) -> Scene:
    """Return ``scene`` with shapes of more than ``most`` nodes as several that look the same.

    Contours whose boxes meet stay together, as one may be a hole in the other, or both may be translucent.
    Shapes that are filled and stroked stay whole.
    """
    contours = scene.first_contours()
    points = np.diff(scene.starts)
    cubic = scene.basis[scene.contour_shapes()] == Basis.CUBIC
    nodes: IndexArray = np.where(cubic, -(-points // 3), points).astype(np.intp)
    total = np.add.reduceat(np.append(nodes, 0), contours[:-1]) if len(scene) else nodes
    large = (total > most) & (np.diff(contours) > 1) & scene.are_alone()
    if not large.any():
        return scene
    parts: list[list[IndexArray]] = [[np.arange(low, high)] for low, high in itertools.pairwise(contours)]
    ends = [extreme.reduceat(scene.points, scene.starts[:-1], axis=0) for extreme in (np.minimum, np.maximum)]
    boxes = np.concatenate(ends, axis=1)
    # Contours closer to each other than this [px] stay in one path: the edges of both share pixels.
    margin = 1.0
    for shape in np.flatnonzero(large).tolist():
        own = parts[shape][0]
        pad = 0.5 * (margin + float(scene.widths[shape]))
        parts[shape] = [own[part] for part in _packed(_clusters(boxes[own], pad), nodes[own], most)]
    return with_parts(scene, parts)


def _clusters(boxes: FloatArray, pad: float) -> list[list[int]]:
    """Return groups of contours whose boxes, shape (contour, 4), meet when grown by ``pad``."""
    low, high = boxes[:, :2] - pad, boxes[:, 2:] + pad
    owner = np.arange(len(boxes))
    for i in range(1, len(boxes)):
        met = ((low[:i] < high[i]) & (low[i] < high[:i])).all(axis=1)
        if met.any():
            names = np.append(np.unique(owner[:i][met]), i)
            owner[np.isin(owner, names)] = names.min()
    return [np.flatnonzero(owner == name).tolist() for name in np.unique(owner)]


def _packed(clusters: list[list[int]], nodes: IndexArray, most: int) -> list[list[int]]:
    """Return clusters joined, one after another, into parts of up to ``most`` nodes."""
    parts: list[list[int]] = []
    left = 0
    for cluster in clusters:
        need = int(nodes[cluster].sum())
        if not parts or need > left:
            parts.append([])
            left = most
        parts[-1] += cluster
        left -= need
    return parts


def with_parts(scene: Scene, parts: list[list[IndexArray]]) -> Scene:
    """Return ``scene`` with shapes split into ``parts``: lists of contours, by shape."""
    # One contour of each stands for all until the parts have their own.
    ones = scene.first_contours()[:-1]
    bare = _with_contours(scene, scene, ones, np.ones(len(scene), np.intp))
    split = bare.take(np.repeat(np.arange(len(scene)), [len(own) for own in parts]))
    order = [part for own in parts for part in own]
    return _with_contours(split, scene, np.concatenate(order), np.array([len(part) for part in order]))


def _with_contours(shapes: Scene, scene: Scene, contours: IndexArray, counts: IndexArray) -> Scene:
    """Return ``shapes`` with contours of ``scene``, of which each shape has so many."""
    points = np.diff(scene.starts)[contours]
    starts = starts_of(points)
    return replace(
        shapes,
        points=scene.points[ranges(scene.starts[contours], points)],
        starts=starts,
        closed=scene.closed[contours],
        first=starts[starts_of(counts)],
    )


def rows_of(scene: Scene, contours: IndexArray) -> IndexArray:
    """Return the rows of the points of a few contours, for which this is faster than ``ranges``."""
    starts = scene.starts
    return np.concatenate([np.arange(starts[c], starts[c + 1]) for c in contours.tolist()])
