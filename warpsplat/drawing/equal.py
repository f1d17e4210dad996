"""Outlines that the image shows no different from one another become equal: a glyph that is repeated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.drawing import prices
from warpsplat.drawing.cells import Cells, cells_around, joined, sum_within
from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.shapes import Errors, cubics_of, with_contours
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.portable.elementary import hypot
from warpsplat.scene import IndexArray, Scene
from warpsplat.svg.primitives import primitives
from warpsplat.svg.sizes import USE
from warpsplat.svg.symbols import parts_of, rows_of

Floats = npt.NDArray[np.float64]

MOST_APART = 0.6
"""Largest difference of two outlines' moments that are likely equal [px]."""

SAMPLES_PER_CUBIC = 8

Refit = Callable[[Drawing], Drawing]
"""Fits the outlines of a drawing for some steps."""


Equal = list[IndexArray]
"""Indices of the contours of each of some equal outlines, in corresponding order."""


def with_equal_outlines(
    drawing: Drawing, errors_of: Errors, errors: Floats, worth: float, refit: Refit
) -> tuple[Drawing, list[Equal]]:
    """Return a drawing in which outlines are equal where that costs less error than their bytes are worth.

    All that are likely equal get the nodes of one of them, are fitted, and then take their mean.

    Args:
        drawing: Fitted.
        errors_of: The judge of drawings.
        errors: Those of the drawing.
        worth: Mean squared error that a byte is worth.
        refit: The fit.
    """
    groups = _likely(drawing.scene)
    cells = {int(part[0]): _cells(drawing.scene, part) for group in groups for part in group}
    saved = {
        int(part[0]): prices.CUBIC * len(rows_of(drawing.scene, part)) / 3 - USE
        for group in groups
        for part in group
    }
    while groups:
        made = _averaged(refit(_with_nodes_of_one(drawing, groups)), groups)
        growth = errors_of(made) - errors
        kept = []
        for group in groups:
            near = [p for p in group if sum_within(growth, cells[int(p[0])]) <= saved[int(p[0])] * worth]
            kept.append(near)
        if all(len(a) == len(b) for a, b in zip(kept, groups, strict=True)):
            return made, groups
        groups = [group for group in kept if len(group) > 1]
    return drawing, []


def _likely(scene: Scene) -> list[Equal]:
    """Return groups of parts of shapes with about the same moments, each with its most usual one first."""
    basic = {contour for contour, _ in primitives(scene, scene.points.astype(np.float64))}
    parts = [part for part in parts_of(scene) if len(part) > 1 or int(part[0]) not in basic]
    parts = [p for p in parts if prices.CUBIC * len(rows_of(scene, p)) / 3 > USE]
    if len(parts) < 2:
        return []
    counts = np.array([len(part) for part in parts])
    moments = np.stack([_moments(scene, part)[1] for part in parts])
    left = np.ones(len(parts), np.bool_)
    groups = []
    for i in range(len(parts)):
        if not left[i]:
            continue
        near = left & (counts == counts[i]) & (np.abs(moments - moments[i]).max(axis=1) <= MOST_APART)
        index = np.flatnonzero(near)
        left[index] = False
        if len(index) > 1:
            off = np.abs(moments[index] - moments[index].mean(axis=0)).sum(axis=1)
            groups.append([parts[k] for k in index[np.argsort(off, kind="stable")].tolist()])
    return groups


def _moments(scene: Scene, part: IndexArray) -> tuple[Floats, Floats]:
    """Return the centre of an outline, and numbers that describe its form [px]."""
    places, weights, boxes = [], [], []
    for contour in part.tolist():
        t = (np.arange(SAMPLES_PER_CUBIC) + 0.5) / SAMPLES_PER_CUBIC
        points = points_at(cubics_of(scene, contour), t).reshape(-1, 2)
        along = (np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)) / 2
        places.append(points)
        weights.append(hypot(along[:, 0], along[:, 1]))
        boxes.append(np.ptp(points, axis=0))
    points, weight = np.concatenate(places), np.concatenate(weights)
    weight = weight / max(float(weight.sum()), 1e-9)
    center = (weight[:, None] * points).sum(axis=0)
    x, y = (points - center).T
    scale = max(float(np.sqrt((weight * (x * x + y * y)).sum())), 1e-6)
    u, v = x / scale, y / scale
    terms = (u * u, v * v, u * v, u * u * u, v * v * v, u * u * v, u * v * v)
    form = [scale * float((weight * term).sum()) for term in terms]
    return center, np.array([*np.max(boxes, axis=0), *form])


def _cells(scene: Scene, part: IndexArray) -> Cells:
    """Return the cells around an outline."""
    return joined([own for contour in part.tolist() for own in cells_around(cubics_of(scene, contour))])


def _with_nodes_of_one(drawing: Drawing, groups: list[Equal]) -> Drawing:
    """Return a drawing in which the outlines of a group have the nodes of its first one, moved."""
    scene, contours = drawing.scene, {}
    for group in groups:
        center = _moments(scene, group[0])[0]
        for part in group[1:]:
            shift = _moments(scene, part)[0] - center
            for own, model in zip(part.tolist(), group[0].tolist(), strict=True):
                rows = slice(*scene.starts[model : model + 2].tolist())
                contours[own] = scene.points[rows] + shift, drawing.joints[rows]
    return with_contours(drawing, contours)


def _averaged(drawing: Drawing, groups: list[Equal]) -> Drawing:
    """Return a drawing in which the outlines of each group, which have the same nodes, are their mean."""
    points = drawing.scene.points.astype(np.float64)
    for group in groups:
        rows = np.stack([rows_of(drawing.scene, part) for part in group])
        places = points[rows].mean(axis=1, keepdims=True)
        points[rows] = (points[rows] - places).mean(axis=0) + places
    return replace(drawing, scene=replace(drawing.scene, points=points.astype(np.float32)))


def on_grid(scene: Scene, equal: list[Equal], per_pixel: float) -> tuple[Scene, npt.NDArray[np.bool_]]:
    """Return a rounded scene in which equal outlines are equal again, and which points are theirs.

    Args:
        scene: Rounded.
        equal: Outlines.
        per_pixel: Units of the view box to a pixel.
    """
    points, held = scene.points.astype(np.float64), np.zeros(len(scene.points), np.bool_)
    for one in equal:
        rows = np.stack([rows_of(scene, part) for part in one])
        steps = (points[rows] - points[rows[0]]).mean(axis=1, keepdims=True)
        points[rows] = points[rows[0]] + np.round(steps * per_pixel) / per_pixel
        held[rows] = True
    return replace(scene, points=points.astype(np.float32)), held
