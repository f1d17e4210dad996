"""Measures of shapes: outlines, areas, boxes."""

from __future__ import annotations

import numpy as np

from warpsplat.scene.attributes import Kind
from warpsplat.scene.scene import FloatArray, Scene

PIECES = 8
"""Straight pieces a cubic that measures are taken on."""


def cubics(points: FloatArray, kind: Kind) -> FloatArray:
    """Cubics of shapes with equally many points, (shape, point, 2) -> (shape, cubic, 4, 2)."""
    count = points.shape[1]
    starts = np.arange(0, count - (kind == Kind.STROKE), 3)
    return points[:, (starts[:, None] + np.arange(4)[None, :]) % count]


def flatten(points: FloatArray, kind: Kind, pieces: int = PIECES) -> FloatArray:
    """Outlines as polylines of ``pieces`` pieces a cubic: (shape, point, 2) -> (shape, vertex, 2)."""
    t = np.arange(pieces, dtype=np.float32)[:, None] / pieces
    s = 1 - t
    weights = np.concatenate([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=1)
    vertices = np.einsum("vk,cjkx->cjvx", weights, cubics(points, kind)).reshape(len(points), -1, 2)
    if kind == Kind.STROKE:
        vertices = np.concatenate([vertices, points[:, -1:]], axis=1)
    return vertices.astype(np.float32)


def areas(scene: Scene) -> FloatArray:
    """Area of each shape [canvas units squared]: the outline's, or length times width; shape (shape,)."""
    result = np.zeros(len(scene), np.float32)
    for kind, index, points in scene.alike():
        vertices = flatten(points, kind)
        if kind == Kind.STROKE:
            length = np.linalg.norm(np.diff(vertices, axis=1), axis=2).sum(axis=1)
            result[index] = length * scene.widths[index]
        else:
            x, y = vertices[..., 0], vertices[..., 1]
            doubled = x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)
            result[index] = 0.5 * np.abs(doubled.sum(axis=1))
    return result


def bounds(scene: Scene) -> FloatArray:
    """Boxes (x0, y0, x1, y1) of the shapes [canvas units], stroke width included; shape (shape, 4)."""
    result = np.zeros((len(scene), 4), np.float32)
    for kind, index, points in scene.alike():
        vertices = flatten(points, kind)
        pad = 0.5 * scene.widths[index, None]
        result[index] = np.concatenate([vertices.min(axis=1) - pad, vertices.max(axis=1) + pad], axis=1)
    return result
