"""Outlines that the image shows no different from circles, ellipses and rectangles become just that."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing import prices
from warpsplat.drawing.cells import Cells, cells_around, joined, sum_within
from warpsplat.drawing.constraints import SAME_COORDINATE, Drawing, summed
from warpsplat.drawing.primitive_fits import (
    FAMILIES,
    Family,
    Fits,
    OutlinePoints,
    nearest,
    shape_of,
)
from warpsplat.drawing.primitive_fits import areas as shape_areas
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.drawing.trace.contours import joints_of
from warpsplat.drawing.trace.curves import Pieces, areas_of
from warpsplat.portable.elementary import hypot
from warpsplat.scene import FloatArray, IndexArray, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.primitives import Primitive
from warpsplat.svg.primitives import cubics_of as primitive_cubics

Floats = npt.NDArray[np.float64]

SAMPLES = 96
"""Points by which an outline is compared with a shape."""

MOST_OFF = 0.6
"""Largest distance of an outline from its basic shape [px]."""

LEAST_SEEN = 0.6
"""Least share of an outline that shows, by its length: what other shapes hide may be anywhere."""

BESIDE = 1.5
"""Distance from an outline at which the colours on both sides are those of the areas [px]."""

SEEN = 1e-3
"""Least squared difference of these colours of an outline that shows: 5 levels in each channel."""

Errors = Callable[[Drawing], Floats]
"""Gives the share of each cell in a drawing's mean squared error, as ``drawing.cells.by_cell``."""


@dataclass(frozen=True)
class ShapeCandidate:
    """A basic shape in place of a contour."""

    contour: int
    cubics: Floats
    """Cubics of the contour, shape (piece, 4, 2)."""
    made: Primitive
    saved: float
    """Bytes."""

    def cells(self) -> Cells:
        """Return the cells that it changes."""
        return joined(cells_around(np.concatenate([self.cubics, self.made.cubics()])))


def with_shapes(
    target: FloatArray,
    drawing: Drawing,
    errors_of: Errors,
    errors: Floats,
    worth: float,
    over: Callable[[], bool] = bool,
) -> Drawing:
    """Return a drawing with exact basic shapes where they cost less error than their bytes are worth.

    Args:
        target: The image, as for ``finish_drawing``.
        drawing: Fitted.
        errors_of: The judge of drawings.
        errors: Those of the drawing.
        worth: Mean squared error that a byte is worth.
        over: Whether there is no time for more.
    """
    candidates = _candidates(target, drawing, worth, over)
    if not candidates:
        return drawing
    growth = errors_of(_replaced(drawing, candidates)) - errors
    taken = [one for one in candidates if sum_within(growth, one.cells()) <= one.saved * worth]
    return _replaced(drawing, taken) if taken else drawing


def _candidates(
    target: FloatArray, drawing: Drawing, worth: float, over: Callable[[], bool]
) -> list[ShapeCandidate]:
    """Return the basic shape of each contour that is near to one, the cheapest by error and bytes."""
    scene = drawing.scene
    contours = np.flatnonzero(np.diff(scene.starts) >= 6)
    if not len(contours):
        return []
    samples, is_likely = _samples(target, _points_along(scene, contours))
    samples = samples.take(np.flatnonzero(is_likely))
    contours = contours[is_likely]
    if not len(contours):
        return []
    areas, sizes = areas_of(samples.points).astype(np.float64), _sizes(drawing)[contours]
    found: dict[int, ShapeCandidate] = {}
    least = np.full(len(contours), np.inf)
    for family in FAMILIES:
        # Families come by size: a shape that costs less than the size of the next one alone is the best.
        rows = np.flatnonzero(least >= worth * family.size)
        if not len(rows) or over():
            break
        own = samples.take(rows)
        fits = nearest(family, own)
        costs = _costs(family, fits, own, areas[rows], worth)
        for k in np.flatnonzero(costs < least[rows]).tolist():
            i = int(rows[k])
            contour, saved = int(contours[i]), float(sizes[i]) - family.size
            made = shape_of(family, fits.values[k], is_clockwise=bool(areas[i] > 0))
            found[i] = ShapeCandidate(contour, cubics_of(scene, contour), made, saved)
        least[rows] = np.minimum(least[rows], costs)
    return [found[i] for i in sorted(found)]


def cubics_of(scene: Scene, contour: int) -> Floats:
    """Return the pieces of a contour, shape (piece, 4, 2)."""
    ring = scene.points[scene.starts[contour] : scene.starts[contour + 1]].astype(np.float64)
    return np.concatenate([ring, ring[:1]])[np.arange(0, len(ring), 3)[:, None] + np.arange(4)]


def _points_along(scene: Scene, contours: IndexArray) -> Floats:
    """Return equally many points of contours, shape (contour, sample, 2), as many on each piece of one."""
    first, count = scene.starts[contours, None], np.diff(scene.starts)[contours, None]
    place = (np.arange(SAMPLES) + 0.5) / SAMPLES * (count / 3)
    piece = np.floor(place).astype(np.intp)
    rows = first[..., None] + (3 * piece[..., None] + np.arange(4)) % count[..., None]
    cubics = scene.points[rows].astype(np.float64)
    return np.asarray(points_at(cubics, (place - piece)[..., None])[..., 0, :])


def merge_near(values: Floats, stiffness: Floats, price: float) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return values, near ones replaced by their mean, and how many each stands for.

    Args:
        values: Shape (value,).
        stiffness: Cost of the square of each one's change.
        price: Most that merging two groups may cost.
    """
    order = np.argsort(values, kind="stable")
    mean, weight = values[order], np.maximum(stiffness[order], 1e-30)
    size = np.ones(len(values), np.int64)
    while len(mean) > 1:
        cost = np.diff(mean) ** 2 * weight[1:] * weight[:-1] / (weight[1:] + weight[:-1])
        k = int(cost.argmin())
        if cost[k] > price:
            break
        mean[k] = (mean[k] * weight[k] + mean[k + 1] * weight[k + 1]) / (weight[k] + weight[k + 1])
        weight[k] += weight[k + 1]
        size[k] += size[k + 1]
        mean, weight, size = (np.delete(x, k + 1) for x in (mean, weight, size))
    found, counts = np.empty_like(values), np.empty(len(values), np.int64)
    found[order], counts[order] = np.repeat(mean, size), np.repeat(size, size)
    return found, counts


def _samples(target: FloatArray, points: Floats) -> tuple[OutlinePoints, npt.NDArray[np.bool_]]:
    """Return points of contours with their weights, and which of the contours mostly show.

    A distance of 1 px along 1 px costs the squared difference of the colours on both sides, as a share of the
    image's mean squared error.
    """
    along = (np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)) / 2
    lengths = np.maximum(hypot(along[..., 0], along[..., 1]), 1e-9)
    normals = np.stack([-along[..., 1], along[..., 0]], axis=2) / lengths[..., None]
    height, width = target.shape[:2]
    sides = []
    for side in (-BESIDE, BESIDE):
        places = np.floor(points + side * normals).astype(np.intp)
        x, y = np.clip(places[..., 0], 0, width - 1), np.clip(places[..., 1], 0, height - 1)
        sides.append(target[y, x].astype(np.float64))
    contrast = ((sides[1] - sides[0]) ** 2).sum(axis=2)
    shows = contrast > SEEN
    seen = (lengths * shows).sum(axis=1) >= LEAST_SEEN * lengths.sum(axis=1)
    weights = np.where(shows, contrast, 0) * lengths / (3 * width * height)
    return OutlinePoints(points, weights.astype(np.float64)), seen


def _sizes(drawing: Drawing) -> Floats:
    """Return about the bytes of each contour."""
    cubics, starts = drawing.cubics(), drawing.scene.starts
    is_level = np.abs(cubics[:, 3] - cubics[:, 0]).min(axis=1) < SAME_COORDINATE
    size = np.where(drawing.lines(), np.where(is_level, prices.LEVEL, prices.LINE), prices.CUBIC)
    owner = np.repeat(np.arange(len(starts) - 1), np.diff(starts) // 3)
    return prices.MOVE + summed(owner, size, len(starts) - 1)


def _costs(family: Family, fits: Fits, samples: OutlinePoints, areas: Floats, worth: float) -> Floats:
    """Return the cost of each shape of a family, in error and bytes; infinite where it is too far off."""
    far = np.abs(fits.off) > MOST_OFF
    shown = samples.weights > 0
    near = (shown & ~far).sum(axis=1) >= LEAST_SEEN * fits.off.shape[1]
    missing = np.abs(np.abs(areas) - shape_areas(family, fits.values))
    same = missing <= 4 * MOST_OFF * fits.values[:, 2:].max(axis=1)
    cost = (samples.weights * np.minimum(np.abs(fits.off), MOST_OFF) ** 2).sum(axis=1) + worth * family.size
    return np.where(near & (same | (far | ~shown).any(axis=1)), cost, np.inf)


def _replaced(drawing: Drawing, chosen: Sequence[ShapeCandidate]) -> Drawing:
    """Return a drawing with basic shapes in place of contours."""
    cubics = primitive_cubics([one.made for one in chosen])
    joints = joints_of([Pieces(own, _is_line(own)) for own in cubics])
    ends = np.cumsum([3 * len(own) for own in cubics])
    contours = {
        one.contour: (own[:, :3].reshape(-1, 2), turns)
        for one, own, turns in zip(chosen, cubics, np.split(joints, ends[:-1]), strict=True)
    }
    return with_contours(drawing, contours)


def with_contours(
    drawing: Drawing, contours: Mapping[int, tuple[npt.NDArray[Any], npt.NDArray[Any]]]
) -> Drawing:
    """Return a drawing with other points and joints of some contours."""
    scene = drawing.scene
    starts = scene.starts.tolist()
    points = [scene.points[a:b] for a, b in itertools.pairwise(starts)]
    joints = [drawing.joints[a:b] for a, b in itertools.pairwise(starts)]
    for contour, (own_points, own_joints) in contours.items():
        points[contour], joints[contour] = own_points.astype(np.float32), own_joints.astype(np.int32)
    after = starts_of(np.array([len(own) for own in points], np.int32))
    first = after[np.searchsorted(scene.starts, scene.first)]
    changed = replace(scene, points=np.concatenate(points), starts=after, first=first)
    return Drawing(changed, np.concatenate(joints))


def _is_line(cubics: Floats) -> npt.NDArray[np.bool_]:
    """Return which pieces of a basic shape are lines: level or upright."""
    return np.asarray((np.abs(cubics[:, 3] - cubics[:, 0]) < SAME_COORDINATE).any(axis=1))
