"""Outlines, areas and boxes of shapes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from warpsplat.forms import form_of
from warpsplat.portable.linear import product
from warpsplat.scene.attributes import Basis, Kind
from warpsplat.scene.scene import FloatArray, Scene

PIECES = 8
"""Straight pieces of a Bézier from which areas and boxes are computed."""

ARC_HANDLE = 4 * (math.sqrt(2) - 1) / 3
"""Handles of the cubic nearest to a quarter of a circle, over its radius."""


def beziers(points: FloatArray, closed: bool, basis: Basis) -> FloatArray:
    """Return contours of equal length as cubics: (contour, point, 2) -> (contour, Bézier, 4, 2)."""
    if basis.is_form:
        points, basis = form_of(basis.name).outline(points, closed), Basis.CUBIC
    if basis == Basis.CUBIC:
        count = points.shape[1]
        starts = np.arange(0, count - (not closed), 3)
        return points[:, (starts[:, None] + np.arange(4)[None, :]) % count]
    if closed:
        before, middle, after = np.roll(points, 1, axis=1), points, np.roll(points, -1, axis=1)
    else:
        before, middle, after = points[:, :-2], points[:, 1:-1], points[:, 2:]
    start, end = (before + middle) / 2, (middle + after) / 2
    if not closed:
        start[:, 0], end[:, -1] = points[:, 0], points[:, -1]
    return np.stack([start, (start + 2 * middle) / 3, (end + 2 * middle) / 3, end], axis=2)


def flatten(points: FloatArray, closed: bool, basis: Basis, pieces: int = PIECES) -> FloatArray:
    """Return contours as polylines, ``pieces`` to a Bézier: (contour, point, 2) -> (contour, vertex, 2)."""
    t = np.arange(pieces, dtype=np.float32)[:, None] / pieces
    s = 1 - t
    weights = np.concatenate([s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t], axis=1)
    curves = beziers(points, closed, basis)
    # One product for all Béziers: sums over long rows take a fraction of the time.
    rows = product(weights, np.moveaxis(curves, 2, 0).reshape(4, -1))
    vertices = np.moveaxis(rows.reshape(pieces, *curves.shape[:2], 2), 0, 2).reshape(len(points), -1, 2)
    if not closed:
        vertices = np.concatenate([vertices, points[:, -1:]], axis=1)
    return vertices.astype(np.float32)


def areas(scene: Scene) -> FloatArray:
    """Return the area of each shape [canvas units squared], shape (shape,).

    That of a fill is what its contours enclose, less holes; that of a stroke is its length times its width.
    """
    result = np.zeros(len(scene), np.float64)
    for kind, basis, closed, shapes, _, points in scene.alike():
        vertices = flatten(points, closed, basis)
        following = np.roll(vertices, -1, axis=1)
        if kind == Kind.STROKE:
            steps = np.linalg.norm(following - vertices, axis=2)
            length = steps.sum(axis=1) if closed else steps[:, :-1].sum(axis=1)
            np.add.at(result, shapes, length * scene.widths[shapes])
        else:
            doubled = vertices[..., 0] * following[..., 1] - vertices[..., 1] * following[..., 0]
            np.add.at(result, shapes, 0.5 * doubled.sum(axis=1))
    return np.abs(result).astype(np.float32)


def most_seen(scene: Scene, count: int, base: int = 0) -> Scene:
    """Return the ``count`` shapes of a scene that show most, among them its first ``base`` ones."""
    seen = areas(scene) * scene.opacities
    seen[:base] = np.inf
    return scene.take(np.sort(np.argsort(seen, kind="stable")[max(len(scene) - count, 0) :]))


def bounds(scene: Scene) -> FloatArray:
    """Return the boxes (x0, y0, x1, y1) of the shapes [canvas units] with their strokes, shape (shape, 4)."""
    low = np.full((len(scene), 2), np.inf, np.float32)
    high = np.full((len(scene), 2), -np.inf, np.float32)
    for _, basis, closed, shapes, _, points in scene.alike():
        vertices = flatten(points, closed, basis)
        np.minimum.at(low, shapes, vertices.min(axis=1))
        np.maximum.at(high, shapes, vertices.max(axis=1))
    pad = 0.5 * scene.widths[:, None]
    return np.concatenate([low - pad, high + pad], axis=1)


def enlarged(scene: Scene, factor: float, width: int, height: int) -> Scene:
    """Return a scene ``factor`` times as large, on a canvas of ``width`` x ``height`` units."""
    return replace(
        scene,
        canvas=replace(scene.canvas, width=width, height=height),
        points=scene.points * factor,
        widths=scene.widths * factor,
        frames=scene.frames * factor,
        dashes=tuple(tuple(factor * length for length in pattern) for pattern in scene.dashes),
    )
