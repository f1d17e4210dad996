"""Outlines that the image shows no different from circles, ellipses and rectangles become just that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.cells import Cells, cells_around, joined, sum_within
from warpsplat.drawing.primitive_fits import FAMILIES, Family, Fits, Samples, nearest
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.drawing.trace.contours import joints_of
from warpsplat.drawing.trace.curves import Pieces
from warpsplat.fit.constraints import SAME_COORDINATE, Drawing
from warpsplat.kernels.constants import NONE
from warpsplat.portable.elementary import hypot
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.primitives import Primitive

Floats = npt.NDArray[np.float64]

MOST_PIECES = 24
"""Outlines of more pieces are no basic shapes."""

SAMPLES_PER_PIECE = 12

MOST_OFF = 0.6
"""Largest distance of an outline from its basic shape [px]."""

LEAST_SEEN = 0.6
"""Least share of an outline that shows, by its length: what other shapes hide may be anywhere."""

BESIDE = 1.5
"""Distance from an outline at which the colours on both sides are those of the areas [px]."""

SEEN = 1e-3
"""Least squared difference of these colours of an outline that shows: 5 levels in each channel."""

CUBIC_BYTES, LINE_BYTES, LEVEL_BYTES, MOVE_BYTES = 19, 7, 4, 6
"""Bytes of a cubic, a line, a level or upright one, and the beginning of a contour in a file."""

CHECKS = 4
"""Most renders that confirm replacements: those that cost too much are taken back."""


Errors = Callable[[Drawing], Floats]
"""Gives the share of each cell in a drawing's mean squared error, as ``drawing.cells.by_cell``."""


@dataclass(frozen=True)
class Candidate:
    """A basic shape in place of a contour."""

    contour: int
    made: Primitive
    """In pixels."""
    cells: Cells
    """That it changes."""
    saved: float
    """Bytes."""


def with_shapes(
    target: FloatArray, drawing: Drawing, errors_of: Errors, errors: Floats, worth: float
) -> Drawing:
    """Return a drawing with exact basic shapes where they cost less error than their bytes are worth.

    Args:
        target: The image, as for ``finish_drawing``.
        drawing: Fitted.
        errors_of: The judge of drawings.
        errors: Those of the drawing.
        worth: Mean squared error that a byte is worth.
    """
    left = _candidates(target, drawing.scene, worth)
    for _ in range(CHECKS):
        if not left:
            break
        made = _replaced(drawing, left)
        growth = errors_of(made) - errors
        taken = [one for one in left if sum_within(growth, one.cells) <= one.saved * worth]
        if len(taken) == len(left):
            return made
        left = taken
    return drawing


def _candidates(target: FloatArray, scene: Scene, worth: float) -> list[Candidate]:
    """Return the basic shape of each contour that is near to one, the cheapest by error and bytes."""
    found = []
    for group in scene.alike():
        pieces = group.points.shape[1] // 3
        if not 2 <= pieces <= MOST_PIECES:
            continue
        ring = np.concatenate([group.points, group.points[:, :1]], axis=1).astype(np.float64)
        cubics = ring[:, 3 * np.arange(pieces)[:, None] + np.arange(4)]
        samples, is_likely = _samples(target, cubics)
        likely = np.flatnonzero(is_likely)
        if not len(likely):
            continue
        samples, cubics = Samples(samples.points[likely], samples.weights[likely]), cubics[likely]
        turning = _areas(samples.points) > 0
        sizes = _sizes(cubics)
        made = [nearest(family, samples) for family in FAMILIES]
        costs = np.stack(
            [_costs(family, fits, samples, worth) for family, fits in zip(FAMILIES, made, strict=True)]
        )
        best = costs.argmin(axis=0)
        for i in np.flatnonzero(np.isfinite(costs.min(axis=0))).tolist():
            shape = made[best[i]].shape_of(i, is_clockwise=bool(turning[i]))
            cells = joined([*cells_around(cubics[i]), *cells_around(shape.cubics())])
            saved = float(sizes[i]) - FAMILIES[best[i]].size
            found.append(Candidate(int(group.contours[likely[i]]), shape, cells, saved))
    return found


def _samples(target: FloatArray, cubics: Floats) -> tuple[Samples, npt.NDArray[np.bool_]]:
    """Return points of contours with their weights, and which of the contours mostly show.

    A distance of 1 px along 1 px costs the squared difference of the colours on both sides, as a share of the
    image's mean squared error. ``cubics``: shape (contour, piece, 4, 2).
    """
    t = (np.arange(SAMPLES_PER_PIECE) + 0.5) / SAMPLES_PER_PIECE
    points = points_at(cubics, t).reshape(len(cubics), -1, 2)
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
    return Samples(points, np.where(shows, contrast, 0) * lengths / (3 * width * height)), seen


def _areas(points: Floats) -> Floats:
    """Return the signed areas of polygons (contour, point, 2), those of clockwise ones positive."""
    x, y = points[..., 0], points[..., 1]
    return np.asarray((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2)


def _sizes(cubics: Floats) -> Floats:
    """Return about the bytes of contours (contour, piece, 4, 2)."""
    chord = cubics[..., 3, :] - cubics[..., 0, :]
    thirds = cubics[..., :1, :] + np.array([[1 / 3], [2 / 3]]) * chord[..., None, :]
    is_line = np.abs(cubics[..., 1:3, :] - thirds).max(axis=(-1, -2)) < SAME_COORDINATE
    is_level = is_line & (np.abs(chord).min(axis=-1) < SAME_COORDINATE)
    size = np.where(is_level, LEVEL_BYTES, np.where(is_line, LINE_BYTES, CUBIC_BYTES))
    return np.asarray(MOVE_BYTES + size.sum(axis=1))


def _costs(family: Family, fits: Fits, samples: Samples, worth: float) -> Floats:
    """Return the cost of each shape of a family, in error and bytes; infinite where it is too far off."""
    off = np.where(samples.weights > 0, fits.off, 0)
    near = np.abs(off).max(axis=1) <= MOST_OFF
    whole = np.abs(np.abs(_areas(samples.points)) - fits.areas()) <= MOST_OFF * fits.half.sum(axis=1) * 2
    hidden = (samples.weights == 0).any(axis=1)
    cost = (samples.weights * off**2).sum(axis=1) + worth * family.size
    return np.where(near & (whole | hidden), cost, np.inf)


def _replaced(drawing: Drawing, chosen: Sequence[Candidate]) -> Drawing:
    """Return a drawing with basic shapes in place of contours."""
    scene = drawing.scene
    starts = scene.starts.tolist()
    points = [scene.points[a:b] for a, b in pairwise(starts)]
    joints = [drawing.joints[a:b] for a, b in pairwise(starts)]
    for one in chosen:
        cubics = one.made.cubics()
        points[one.contour] = cubics[:, :3].reshape(-1, 2).astype(np.float32)
        joints[one.contour] = joints_of(Pieces(cubics, _is_line(cubics)))
    counts = np.array([len(own) for own in points], np.int64)
    first = starts_of(counts)[np.searchsorted(scene.starts, scene.first)]
    changed = replace(scene, points=np.concatenate(points), starts=starts_of(counts), first=first)
    return Drawing(changed, np.concatenate(joints), np.full(len(changed.points), NONE, np.int32))


def _is_line(cubics: Floats) -> npt.NDArray[np.bool_]:
    """Return which pieces of a basic shape are lines: level or upright."""
    return np.asarray((np.abs(cubics[:, 3] - cubics[:, 0]) < SAME_COORDINATE).any(axis=1))
