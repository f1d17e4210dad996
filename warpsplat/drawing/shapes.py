"""Outlines that the image shows no different from circles, ellipses and rectangles become just that."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.cells import Cells, cells_around, joined, sum_within
from warpsplat.drawing.constraints import SAME_COORDINATE, Drawing, summed
from warpsplat.drawing.primitive_fits import (
    FAMILIES,
    ROUGH_ROUNDS,
    TOGETHER,
    Family,
    Fits,
    OutlinePoints,
    nearest,
    shape_of,
)
from warpsplat.drawing.primitive_fits import areas as shape_areas
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.drawing.trace.contours import joints_of
from warpsplat.drawing.trace.curves import Pieces
from warpsplat.portable.elementary import hypot
from warpsplat.scene import FloatArray, IndexArray, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.primitives import Primitive
from warpsplat.svg.primitives import cubics_of as primitive_cubics

Floats = npt.NDArray[np.float64]

MOST_PIECES = 24
"""Outlines of more pieces are no basic shapes."""

SAMPLES = 96
"""Points by which an outline is compared with a shape."""

FEWER, ROUGHLY = 4, 1.5
"""One in how many of these tells outlines that are far from any shape, and how much farther those are."""

MOST_OFF = 0.6
"""Largest distance of an outline from its basic shape [px]."""

LEAST_SEEN = 0.6
"""Least share of an outline that shows, by its length: what other shapes hide may be anywhere."""

BESIDE = 1.5
"""Distance from an outline at which the colours on both sides are those of the areas [px]."""

SEEN = 1e-3
"""Least squared difference of these colours of an outline that shows: 5 levels in each channel."""

CUBIC_BYTES, LINE_BYTES, LEVEL_BYTES, MOVE_BYTES, NUMBER_BYTES = 19, 7, 4, 6, 3
"""Bytes of a cubic, a line, a level or upright one, the beginning of a contour, and a number in a file."""

CHECKS = 4
"""Most renders that confirm replacements: those that cost too much are taken back."""


Errors = Callable[[Drawing], Floats]
"""Gives the share of each cell in a drawing's mean squared error, as ``drawing.cells.by_cell``."""


@dataclass(frozen=True)
class ShapeCandidate:
    """A basic shape in place of a contour."""

    contour: int
    cubics: Floats
    """Cubics of the contour, shape (piece, 4, 2)."""
    family: Family
    values: Floats
    """Shape (value,)."""
    stiffness: Floats
    """Error by the square of each value's change, shape (value,)."""
    is_clockwise: bool
    saved: float
    """Bytes."""

    @cached_property
    def made(self) -> Primitive:
        """The shape."""
        return shape_of(self.family, self.values, is_clockwise=self.is_clockwise)


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
    left = with_equal_values(_candidates(target, drawing, worth, over), worth)
    cells = _cells(left)
    for _ in range(CHECKS):
        if not left:
            break
        made = _replaced(drawing, left)
        growth = errors_of(made) - errors
        taken = [one for one in left if sum_within(growth, cells[one.contour]) <= one.saved * worth]
        if len(taken) == len(left):
            return made
        left = taken
    return drawing


def _cells(candidates: Sequence[ShapeCandidate]) -> dict[int, Cells]:
    """Return the cells that each candidate changes, by its contour."""
    found = {}
    for first in range(0, len(candidates), TOGETHER):
        chosen = candidates[first : first + TOGETHER]
        after = primitive_cubics([one.made for one in chosen])
        cubics = [np.concatenate([one.cubics, own]) for one, own in zip(chosen, after, strict=True)]
        around = iter(cells_around(np.concatenate(cubics)))
        for one, own in zip(chosen, cubics, strict=True):
            found[one.contour] = joined(list(itertools.islice(around, len(own))))
    return found


def _candidates(
    target: FloatArray, drawing: Drawing, worth: float, over: Callable[[], bool]
) -> list[ShapeCandidate]:
    """Return the basic shape of each contour that is near to one, the cheapest by error and bytes."""
    scene = drawing.scene
    pieces = np.diff(scene.starts) // 3
    contours = np.flatnonzero((pieces >= 2) & (pieces <= MOST_PIECES))
    if not len(contours):
        return []
    samples, is_likely = _samples(target, _points_along(scene, contours))
    samples = samples.take(np.flatnonzero(is_likely))
    contours = contours[is_likely]
    if not len(contours):
        return []
    areas, sizes = _areas(samples.points), _sizes(drawing)[contours]
    found: dict[int, ShapeCandidate] = {}
    least = np.full(len(contours), np.inf)
    for family in FAMILIES:
        # Families come by size: a shape that costs less than the size of the next one alone is the best.
        rows = np.flatnonzero(least >= worth * family.size)
        if not len(rows) or over():
            break
        rows, begun = _likely(family, rows, samples, worth * (sizes - family.size))
        if not len(rows):
            continue
        own = samples.take(rows)
        fits = nearest(family, own, begun)
        costs = _costs(family, fits, own, areas[rows], worth)
        for k in np.flatnonzero(costs < least[rows]).tolist():
            i = int(rows[k])
            contour, saved = int(contours[i]), float(sizes[i]) - family.size
            values = fits.values[k], fits.stiffness[k]
            found[i] = ShapeCandidate(
                contour, cubics_of(scene, contour), family, *values, bool(areas[i] > 0), saved
            )
        least[rows] = np.minimum(least[rows], costs)
    return [found[i] for i in sorted(found)]


def _likely(
    family: Family, rows: IndexArray, samples: OutlinePoints, most: Floats
) -> tuple[IndexArray, Floats]:
    """Return which of the outlines ``rows`` may become shapes of a family, and the values that these have.

    Few samples and rounds tell. ``most``: the errors that the bytes saved are worth, by outline.
    """
    few = OutlinePoints(samples.points[rows, ::FEWER], samples.weights[rows, ::FEWER])
    fits = nearest(family, few, rounds=ROUGH_ROUNDS)
    off = np.abs(fits.off)
    cost = FEWER * (few.weights * np.minimum(off, MOST_OFF) ** 2).sum(axis=1)
    near = ((few.weights > 0) & (off <= ROUGHLY * MOST_OFF)).sum(axis=1) * ROUGHLY >= LEAST_SEEN * off.shape[
        1
    ]
    likely = near & (cost <= ROUGHLY**2 * most[rows])
    return rows[likely], fits.values[likely]


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


def with_equal_values(candidates: list[ShapeCandidate], worth: float) -> list[ShapeCandidate]:
    """Return candidates with equal sizes and places where they differ by less than a number is worth.

    Values of one kind are merged in pairs, those first that cost least (Ward 1963).
    """
    values = [one.values.copy() for one in candidates]
    saved = [one.saved for one in candidates]
    for kind in ("x", "y", "side", "radius"):
        places = [
            (i, k)
            for i, one in enumerate(candidates)
            for k, name in enumerate(one.family.values)
            if name == kind
        ]
        exact = np.array([values[i][k] for i, k in places])
        stiffness = np.array([candidates[i].stiffness[k] for i, k in places])
        merged, counts = merge_near(exact, stiffness, NUMBER_BYTES * worth)
        for (i, k), value, count in zip(places, merged.tolist(), counts.tolist(), strict=True):
            values[i][k] = value
            saved[i] += NUMBER_BYTES * (count - 1) / count
    return [
        replace(one, values=own, saved=bytes_)
        for one, own, bytes_ in zip(candidates, values, saved, strict=True)
    ]


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


def _areas(points: Floats) -> Floats:
    """Return the signed areas of polygons (contour, point, 2), those of clockwise ones positive."""
    x, y = points[..., 0], points[..., 1]
    return np.asarray((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2)


def _sizes(drawing: Drawing) -> Floats:
    """Return about the bytes of each contour."""
    cubics, starts = drawing.cubics(), drawing.scene.starts
    is_level = np.abs(cubics[:, 3] - cubics[:, 0]).min(axis=1) < SAME_COORDINATE
    size = np.where(drawing.lines(), np.where(is_level, LEVEL_BYTES, LINE_BYTES), CUBIC_BYTES)
    owner = np.repeat(np.arange(len(starts) - 1), np.diff(starts) // 3)
    return MOVE_BYTES + summed(owner, size, len(starts) - 1)


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
