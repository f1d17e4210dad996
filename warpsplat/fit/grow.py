"""Growth: new shapes come on the components of the error, largest first (paper section 3.4, appendix B)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.fit.place import ShapeFactory, pixel_of, shape_angles
from warpsplat.fit.settings import Settings
from warpsplat.portable import elementary, filters
from warpsplat.scene import FloatArray, IndexArray, Scene

ERROR_LEVELS = 8
"""Levels that the error map is quantised to."""


@dataclass(frozen=True)
class Candidates:
    """Places for new shapes, lengths in pixels; each array has shape (candidate,) but ``centres``."""

    centres: FloatArray
    """Shape (candidate, 2)."""
    radii: FloatArray
    """Radius of a circle, for a fill."""
    masses: FloatArray
    """Error that a shape would cover."""
    angles: FloatArray
    """Direction of a stroke [rad]."""
    lengths: FloatArray
    """Length of a stroke; 0 for a fill."""
    widths: FloatArray
    """Width of a stroke."""


def new_shapes(
    settings: Settings,
    scene: Scene,
    target: FloatArray,
    error: FloatArray,
    count: int,
    rng: np.random.Generator,
) -> Scene:
    """Return ``count`` shapes on the components of the quantised error map, the largest error first.

    Where there are too few components, the others are placed at random, in proportion to the error.

    ``scene`` has the canvas; the image ``target``, shape (height, width, 3 or 4), may be smaller. ``error``:
    see ``Objective.by_pixel``, shape (height, width).
    """
    unit = scene.canvas.width / target.shape[1]
    error = np.asarray(filters.gaussian_blur(error, 1.0), np.float32)
    found = candidates(error, mixed=settings.mixed)
    chosen = _without_overlap(found, error.shape, count)
    radius_ratio = 1.2  # radius of a new shape over that of the largest circle in its component of the error
    places, radii = found.centres[chosen], np.maximum(radius_ratio * found.radii[chosen], 1.5)
    missing = count - len(chosen)
    if missing > 0:
        weight = error.ravel().astype(np.float64) + 1e-12
        picked = rng.choice(len(weight), missing, p=weight / weight.sum())
        row, column = np.divmod(picked, target.shape[1])
        places = np.concatenate([places, np.stack([column + 0.5, row + 0.5], axis=1)]).astype(np.float32)
        radii = np.concatenate([radii, np.full(missing, 2.0, np.float32)])
    column, row = pixel_of(places, target)
    colors = straight(np.asarray(filters.gaussian_blur(target, 1.0)[row, column], np.float32))
    angles = shape_angles(settings, target, places, 2.0)
    factory = ShapeFactory(settings, scene.canvas)
    shapes = factory.place(places * unit, np.pi * (radii * unit) ** 2, angles, colors)
    long = np.flatnonzero(found.lengths[chosen])
    if not len(long):
        return shapes
    bars = np.array(chosen)[long]
    lengths, widths = found.lengths[bars] * unit, np.maximum(found.widths[bars], 1.0) * unit
    strokes = factory.place_strokes(places[long] * unit, lengths, widths, found.angles[bars], colors[long])
    order = np.arange(count)
    order[long] = count + np.arange(len(long))
    return shapes.append(strokes).take(order)


def candidates(error: FloatArray, *, mixed: bool) -> Candidates:
    """Return the components of the error map's level sets as candidates.

    A component becomes its largest inscribed circle: a shape there covers error only, however branched the
    component is. If shapes may be ``mixed``, it becomes a stroke where that covers more.
    """
    # Quantile of the error that the highest level begins at: single pixels do not set the scale.
    top_quantile = 0.995
    top = max(float(np.quantile(error, top_quantile)), 1e-12)
    levels = [_level_set(error, top * level / ERROR_LEVELS, mixed) for level in range(1, ERROR_LEVELS)]
    arrays = [np.concatenate([getattr(found, f.name) for found in levels]) for f in fields(Candidates)]
    return Candidates(*arrays)


def _level_set(error: FloatArray, threshold: float, mixed: bool) -> Candidates:
    """Return the components of the pixels whose error is at least ``threshold``."""
    inside = error >= threshold
    mask = inside.view(np.uint8)
    number, labels = cv2.connectedComponents(mask, connectivity=4)
    # Padded, so that the border of the image bounds a circle as well.
    depth = filters.distance(np.pad(mask, 1))[1:-1, 1:-1]
    # The deepest pixel of a component has no deeper neighbour; of several the last is taken.
    peak = np.flatnonzero(inside & (depth >= cv2.dilate(depth, np.ones((3, 3)))))
    peak = peak[np.argsort(depth.ravel()[peak], kind="stable")]
    deepest = np.zeros(number, np.intp)
    deepest[labels.ravel()[peak]] = peak
    row, column = np.divmod(deepest[1:], error.shape[1])
    pixel = np.flatnonzero(inside)
    label = labels.ravel()[pixel]
    size = np.bincount(label, minlength=number)[1:]
    mass = np.bincount(label, weights=error.ravel()[pixel], minlength=number)[1:]
    radius = depth[row, column]
    share = np.minimum(1.0, np.pi * radius**2 / size)
    centre = np.stack([column + 0.5, row + 0.5], axis=1)
    stroke: list[npt.NDArray[Any]] = [np.zeros(len(radius))] * 3
    # Length over width of a component that gets a stroke: on shorter ones fills are as good
    # (docs/experiments.md).
    min_aspect = 8.0
    min_stroke_share = 0.8  # minimum share of the component that a stroke has to cover ..
    # ... and minimum ratio of that share to the one that a fill covers.
    min_advantage = 2.0
    if mixed:
        middle, angle, length, width, covered = _bars(*np.divmod(pixel, error.shape[1]), label, number)
        least = np.maximum(min_stroke_share, min_advantage * share)
        long = (length > min_aspect * width) & (covered > least)
        share = np.where(long, covered, share)
        centre = np.where(long[:, None], middle, centre)
        stroke = [angle, np.where(long, length, 0.0), width]
    arrays = (centre, radius, mass * share, *stroke)
    return Candidates(*(np.asarray(array, np.float32) for array in arrays))


def _without_overlap(found: Candidates, size: tuple[int, ...], count: int) -> list[int]:
    """Return at most ``count`` candidates, the largest error first, whose centres no earlier one covers."""
    chosen: list[int] = []
    covered = np.zeros(size, np.uint8)
    for i in np.argsort(-found.masses, kind="stable").tolist():
        if len(chosen) == count:
            break
        x, y = int(found.centres[i, 0]), int(found.centres[i, 1])
        if covered[y, x]:
            continue
        chosen.append(i)
        if not found.lengths[i]:
            cv2.circle(covered, (x, y), max(1, round(float(found.radii[i]))), 1, -1)
            continue
        angle, half = float(found.angles[i]), float(found.lengths[i]) / 2
        dx, dy = round(half * float(elementary.cos(angle))), round(half * float(elementary.sin(angle)))
        cv2.line(covered, (x - dx, y - dy), (x + dx, y + dy), 1, max(1, round(float(found.widths[i]))))
    return chosen


def _bars(
    row: IndexArray, column: IndexArray, label: npt.NDArray[Any], number: int
) -> tuple[npt.NDArray[Any], ...]:
    """Return for each component 1 to ``number`` - 1 the straight bar with its area and second moments.

    ``label``: component of the pixels at ``row`` and ``column``. The result: centres [px], shape
    (component, 2), angles [rad], lengths and widths [px], and the share of the component that the bar covers,
    estimated by how much the component spreads sideways.
    """
    size = np.bincount(label, minlength=number)[1:]

    def mean(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return np.asarray(np.bincount(label, weights=values, minlength=number)[1:] / size)

    x, y = column + 0.5, row + 0.5
    cx, cy = mean(x), mean(y)
    # A pixel is a square, whose own second moment is a twelfth.
    xx, yy = mean(x * x) - cx**2 + 1 / 12, mean(y * y) - cy**2 + 1 / 12
    xy = mean(x * y) - cx * cy
    half, root = (xx + yy) / 2, elementary.hypot((xx - yy) / 2, xy)
    length, breadth = np.sqrt(12 * (half + root)), np.sqrt(12 * np.maximum(half - root, 1e-6))
    width = size / length
    angle, share = 0.5 * elementary.arctan2(2 * xy, xx - yy), np.minimum(1.0, width / breadth)
    arrays = (np.stack([cx, cy], axis=1), angle, length, width, share)
    return tuple(np.asarray(array, np.float32) for array in arrays)
