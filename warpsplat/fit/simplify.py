"""Simplification: points of splines that outlines need least are removed, as each costs bytes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.portable.sequences import interp
from warpsplat.scene import Basis, FloatArray, IndexArray, Scene

MIN_SPLINE_POINTS = 4
"""Points that a spline keeps."""

MIN_POINTS_BETWEEN = 2
"""Points between two that are removed together: each removal moves its neighbours."""


def simplify(scene: Scene, worth: FloatArray, count: int) -> tuple[Scene, IndexArray]:
    """Remove the points of splines that cost least, no two of them close to each other.

    ``worth``: cost of a unit of each shape's area, shape (shape,), by which at most ``count`` points go; at
    infinite worth all stay. Return the scene, and the rows of its points that stay.
    """
    found: list[tuple[float, int, int, int, FloatArray]] = []
    for group in scene.alike():
        number = group.points.shape[1]
        if group.basis != Basis.SPLINE or number <= MIN_SPLINE_POINTS:
            continue
        moved, area = without(group.points, group.closed)
        known = np.isfinite(worth[group.shapes])
        removable = np.isfinite(area)  # all but the ends of a stroke
        cost = np.where(removable, area, 0.0) * np.where(known, worth[group.shapes], 0.0)[:, None]
        cost[~removable] = np.inf
        for i in np.flatnonzero(known).tolist():
            first = int(scene.starts[group.contours[i]])
            chosen = _cheapest(cost[i], (number - MIN_SPLINE_POINTS + 1) // 2)
            found += [(float(cost[i, k]), first, k, number, moved[i, k]) for k in chosen]
    found.sort(key=lambda entry: entry[:3])
    points = scene.points.copy()
    keep = np.ones(len(points), np.bool_)
    for _, first, k, number, neighbours in found[:count]:
        points[[first + (k - 1) % number, first + (k + 1) % number]] = neighbours
        keep[first + k] = False
    return replace(scene, points=points).without_points(keep), np.flatnonzero(keep)


def without(points: FloatArray, closed: bool) -> tuple[FloatArray, FloatArray]:
    """Return for every point of splines, shape (shape, point, 2), where its neighbours go if it is removed.

    Their shape is (shape, point, 2, 2). Return also the area that the outline then sweeps, shape (shape,
    point). The ends of splines that are not ``closed`` stay where they are.
    """
    count = points.shape[1]
    around = np.arange(count)[:, None] + np.arange(-3, 4)
    around = around % count if closed else np.clip(around, 0, count - 1)
    window = points[:, around]  # [shape, point, 7, 2]
    samples_per_quadratic = 4  # samples of each quadratic by which the area between two outlines is computed
    t = (np.arange(5 * samples_per_quadratic) + 0.5) / samples_per_quadratic
    old = _quadratics(window, t)
    # Without the point, two quadratics are half as long again as before.
    t = interp(t, [0, 1, 2.5, 4, 5], np.arange(5))
    new = _quadratics(window[..., [0, 1, 2, 4, 5, 6], :], t)
    # Both neighbours move by w times the bulge that the point made: w by least squares.
    bulge = window[..., 3, :] - 0.5 * (window[..., 2, :] + window[..., 4, :])
    unit = np.zeros((6, 1), np.float32)
    unit[2:4] = 1
    share = _quadratics(unit, t)  # [sample, 1]
    gap = old - new
    along = ((gap * bulge[..., None, :]).sum(axis=-1) * share[:, 0]).sum(axis=-1)
    w = along / np.maximum((bulge**2).sum(axis=-1) * (share**2).sum(), 1e-12)
    shift = w[..., None] * bulge
    gap = gap - share * shift[..., None, :]
    direction = np.diff(old, axis=-2)
    middle = 0.5 * (gap[..., 1:, :] + gap[..., :-1, :])
    area = np.abs(direction[..., 0] * middle[..., 1] - direction[..., 1] * middle[..., 0]).sum(axis=-1)
    moved = window[..., [2, 4], :] + shift[..., None, :]
    if not closed:
        moved[:, 1, 0], moved[:, -2, 1] = points[:, 0], points[:, -1]
        area[:, [0, -1]] = np.inf
    return moved, area


def _quadratics(points: npt.NDArray[Any], t: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
    """Evaluate open uniform quadratic B-splines [..., n, 2] at ``t`` in [0, n - 2], [..., m, 2]."""
    k = np.minimum(t.astype(np.intp), points.shape[-2] - 3)
    s = (t - k)[:, None]
    a, b, c = points[..., k, :], points[..., k + 1, :], points[..., k + 2, :]
    return 0.5 * (1 - s) ** 2 * a + (0.5 + s * (1 - s)) * b + 0.5 * s * s * c


def _cheapest(cost: FloatArray, most: int) -> list[int]:
    """Return at most ``most`` places of least finite cost, ``MIN_POINTS_BETWEEN`` apart on the ring."""
    number = len(cost)
    chosen: list[int] = []
    blocked = np.zeros(number, np.bool_)
    for k in np.argsort(cost, kind="stable").tolist():
        if len(chosen) == most or not np.isfinite(cost[k]):
            break
        if not blocked[k]:
            chosen.append(k)
            blocked[np.arange(k - MIN_POINTS_BETWEEN, k + MIN_POINTS_BETWEEN + 1) % number] = True
    return chosen
