"""Measures of shapes: outlines, areas, boxes."""

from __future__ import annotations

import numpy as np

from warpsplat.scene.attributes import Basis, Kind
from warpsplat.scene.scene import FloatArray, Scene

PIECES = 8
"""Straight pieces a Bézier that measures are taken on."""


def beziers(points: FloatArray, kind: Kind, basis: Basis) -> FloatArray:
    """Béziers of shapes with equally many points, as cubics: (shape, point, 2) -> (shape, Bézier, 4, 2)."""
    if basis == Basis.SPLINE:
        return _elevated(points, kind)
    count = points.shape[1]
    starts = np.arange(0, count - (kind == Kind.STROKE), 3)
    return points[:, (starts[:, None] + np.arange(4)[None, :]) % count]


def _elevated(points: FloatArray, kind: Kind) -> FloatArray:
    """The quadratics of splines as cubics."""
    if kind == Kind.FILL:
        before, middle, after = np.roll(points, 1, axis=1), points, np.roll(points, -1, axis=1)
    else:
        before, middle, after = points[:, :-2], points[:, 1:-1], points[:, 2:]
    start, end = (before + middle) / 2, (middle + after) / 2
    if kind == Kind.STROKE:
        start[:, 0], end[:, -1] = points[:, 0], points[:, -1]
    return np.stack([start, (start + 2 * middle) / 3, (end + 2 * middle) / 3, end], axis=2)


def flatten(points: FloatArray, kind: Kind, basis: Basis, pieces: int = PIECES) -> FloatArray:
    """Outlines as polylines of ``pieces`` pieces a Bézier: (shape, point, 2) -> (shape, vertex, 2)."""
    t = np.arange(pieces, dtype=np.float32)[:, None] / pieces
    s = 1 - t
    weights = np.concatenate([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=1)
    curves = beziers(points, kind, basis)
    vertices = np.einsum("vk,cjkx->cjvx", weights, curves).reshape(len(points), -1, 2)
    if kind == Kind.STROKE:
        vertices = np.concatenate([vertices, points[:, -1:]], axis=1)
    return vertices.astype(np.float32)


def areas(scene: Scene) -> FloatArray:
    """Area of each shape [canvas units squared]: the outline's, or length times width; shape (shape,)."""
    result = np.zeros(len(scene), np.float32)
    for kind, basis, index, points in scene.alike():
        vertices = flatten(points, kind, basis)
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
    for kind, basis, index, points in scene.alike():
        vertices = flatten(points, kind, basis)
        pad = 0.5 * scene.widths[index, None]
        result[index] = np.concatenate([vertices.min(axis=1) - pad, vertices.max(axis=1) + pad], axis=1)
    return result
