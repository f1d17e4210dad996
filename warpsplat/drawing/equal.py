"""Outlines that the image shows no different from one another become equal: a glyph that is repeated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.drawing import prices
from warpsplat.drawing.changes import MOST_OFF, changed, contour_change, worthwhile
from warpsplat.drawing.constraints import Drawing, Floats, with_ends
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.fit.problem import Run
from warpsplat.portable.elementary import hypot
from warpsplat.scene import FloatArray, IndexArray, Scene
from warpsplat.svg.parts import rows_of
from warpsplat.svg.primitives import primitives
from warpsplat.svg.sizes import USE
from warpsplat.svg.symbols import parts_of

SAMPLES_PER_CUBIC = 8

Equal = list[IndexArray]
"""Indices of the contours of each of some equal outlines, in corresponding order."""


def with_equal_outlines(
    target: FloatArray, drawing: Drawing, run: Run, worth: float
) -> tuple[Drawing, list[Equal]]:
    """Return a drawing in which outlines are equal where that costs less error than their bytes are worth.

    Arguments are those of ``worthwhile``.
    """
    scene, groups, changes = drawing.scene, _likely(drawing.scene), []
    for model, *others in groups:
        center = _moments(scene, model)[0]
        rows = [slice(*scene.starts[contour : contour + 2].tolist()) for contour in model.tolist()]
        for part in others:
            shift = _moments(scene, part)[0] - center
            made = [(scene.points[own] + shift, drawing.joints[own]) for own in rows]
            changes.append(
                contour_change(drawing, dict(zip(part.tolist(), made, strict=True)), _saved(scene, model))
            )
    taken = worthwhile(target, drawing, run, changes, worth)
    made_equal = {contour for change in taken for contour in change.contours}
    equal = [[group[0], *(part for part in group[1:] if int(part[0]) in made_equal)] for group in groups]
    return changed(drawing, taken), [group for group in equal if len(group) > 1]


def _saved(scene: Scene, part: IndexArray) -> float:
    """Return the bytes that an outline takes more than its use."""
    return prices.CUBIC * len(rows_of(scene, part)) / 3 - USE


def _likely(scene: Scene) -> list[Equal]:
    """Return groups of parts of shapes with about the same moments, each with its most usual one first."""
    basic = {contour for contour, _ in primitives(scene, scene.points.astype(np.float64))}
    parts = [part for part in parts_of(scene) if len(part) > 1 or int(part[0]) not in basic]
    parts = [part for part in parts if _saved(scene, part) > 0]
    if len(parts) < 2:
        return []
    counts = np.array([len(part) for part in parts])
    moments = np.stack([_moments(scene, part)[1] for part in parts])
    left = np.ones(len(parts), np.bool_)
    groups = []
    for i in range(len(parts)):
        if not left[i]:
            continue
        near = left & (counts == counts[i]) & (np.abs(moments - moments[i]).max(axis=1) <= MOST_OFF)
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
        ring = scene.points[slice(*scene.starts[contour : contour + 2].tolist())].astype(np.float64)
        following = np.roll(np.arange(len(ring) // 3), -1)
        points = points_at(with_ends(ring, following), t).reshape(-1, 2)
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
