"""Splines with fewer points: those are removed whose place the outline needs least."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.portable.sequences import interp
from warpsplat.scene import Basis, FloatArray, IndexArray, Scene

SAMPLES = 4
"""Of each quadratic, for the area between two outlines."""

LEAST_POINTS = 4
"""Of a spline."""

APART = 2
"""Points removed in one turn have at least so many others between them: each moves its neighbours."""


def _quadratics(points: npt.NDArray[Any], t: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
    """Open uniform quadratic B-spline of points [..., n, 2] at ``t`` in [0, n - 2], [..., m, 2]."""
    k = np.minimum(t.astype(np.intp), points.shape[-2] - 3)
    s = (t - k)[:, None]
    a, b, c = points[..., k, :], points[..., k + 1, :], points[..., k + 2, :]
    return 0.5 * (1 - s) ** 2 * a + (0.5 + s * (1 - s)) * b + 0.5 * s * s * c


def without(points: FloatArray, closed: bool) -> tuple[FloatArray, FloatArray]:
    """Splines without one of their points each.

    Args:
        points: shape (shape, point, 2).
        closed: whether they are rings; of chains the ends stay where they are.

    Returns:
        for every point of every spline, where its two neighbours go if it is removed, shape
        (shape, point, 2, 2), and the area that the outline then sweeps, shape (shape, point).
    """
    count = points.shape[1]
    near = np.arange(count)[:, None] + np.arange(-3, 4)
    near = near % count if closed else np.clip(near, 0, count - 1)
    window = points[:, near]  # [shape, point, 7, 2]
    t = (np.arange(5 * SAMPLES) + 0.5) / SAMPLES
    old = _quadratics(window, t)
    # Without the point, two quadratics go half as far again as before.
    t = interp(t, [0, 1, 2.5, 4, 5], np.arange(5))
    kept = window[..., [0, 1, 2, 4, 5, 6], :]
    plain = _quadratics(kept, t)
    # Both neighbours move by w times the bulge that the point made.
    bulge = window[..., 3, :] - 0.5 * (window[..., 2, :] + window[..., 4, :])
    unit = np.zeros((6, 1), np.float32)
    unit[2:4] = 1
    share = _quadratics(unit, t)  # [sample, 1]
    missing = old - plain
    along = ((missing * bulge[..., None, :]).sum(axis=-1) * share[:, 0]).sum(axis=-1)
    w = along / np.maximum((bulge**2).sum(axis=-1) * (share**2).sum(), 1e-12)
    shift = w[..., None] * bulge
    apart = missing - share * shift[..., None, :]
    direction = np.diff(old, axis=-2)
    middle = 0.5 * (apart[..., 1:, :] + apart[..., :-1, :])
    area = np.abs(direction[..., 0] * middle[..., 1] - direction[..., 1] * middle[..., 0]).sum(axis=-1)
    moved = window[..., [2, 4], :] + shift[..., None, :]
    if not closed:
        moved[:, 1, 0], moved[:, -2, 1] = points[:, 0], points[:, -1]
        area[:, [0, -1]] = np.inf
    return moved, area


def simplify(scene: Scene, worth: FloatArray, count: int) -> tuple[Scene, IndexArray]:
    """Remove the points of splines that cost least, no two of them near each other.

    Args:
        scene: any shapes; those of cubics stay as they are.
        worth: of a unit of each shape's area, shape (shape,); infinite: all its points stay.
        count: points to remove, at the most.

    Returns:
        the scene, and the rows of its points that stay.
    """
    found: list[tuple[float, int, int, int, FloatArray]] = []
    for group in scene.alike():
        number = group.points.shape[1]
        if group.basis != Basis.SPLINE or number <= LEAST_POINTS:
            continue
        moved, area = without(group.points, group.closed)
        known = np.isfinite(worth[group.shapes])
        free = np.isfinite(area)  # the ends of a stroke are not
        cost = np.where(free, area, 0.0) * np.where(known, worth[group.shapes], 0.0)[:, None]
        cost[~free] = np.inf
        for i in np.flatnonzero(known).tolist():
            first = int(scene.starts[group.contours[i]])
            chosen = _apart(cost[i], (number - LEAST_POINTS + 1) // 2)
            found += [(float(cost[i, k]), first, k, number, moved[i, k]) for k in chosen]
    found.sort(key=lambda entry: entry[:3])
    points = scene.points.copy()
    keep = np.ones(len(points), np.bool_)
    for _, first, k, number, neighbours in found[:count]:
        points[[first + (k - 1) % number, first + (k + 1) % number]] = neighbours
        keep[first + k] = False
    return replace(scene, points=points).without_points(keep), np.flatnonzero(keep)


def _apart(cost: FloatArray, most: int) -> list[int]:
    """The cheapest places, ``most`` at the most and none of infinite cost, with ``APART`` others between any
    two, by way of the ends as well.
    """
    number = len(cost)
    chosen: list[int] = []
    near = bytearray(number)
    for k in np.argsort(cost, kind="stable").tolist():
        if len(chosen) == most or not np.isfinite(cost[k]):
            break
        if not near[k]:
            chosen.append(k)
            for i in range(k - APART, k + APART + 1):
                near[i % number] = 1
    return chosen
