"""Which shapes go and where new ones come (paper section 3.4 and appendix B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares, straight
from warpsplat.fit.place import pixel_of, place, place_strokes, shape_angles
from warpsplat.fit.schedule import opacity_threshold
from warpsplat.fit.settings import Density, Settings
from warpsplat.fit.streaks import Streaks
from warpsplat.portable import elementary, filters
from warpsplat.scene import FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import areas, bounds

BoolArray = npt.NDArray[np.bool_]

ERROR_LEVELS = 8
"""Levels of the quantised error map."""

NEW_RADIUS = 1.2
"""Radius of a new shape over that of the circle inscribed in its component of the error."""

PAIRS_AT_ONCE = 1 << 18
"""Pairs of shapes that ``duplicates`` compares in one go: bounds its memory."""


def duplicates(scene: Scene, density: Density) -> BoolArray:
    """Shapes with a neighbour further in front of nearly their colour and box."""
    boxes = bounds(scene)
    # Boxes that overlap so much have nearly the same left edge: a window over the sorted edges is enough.
    order = np.argsort(boxes[:, 0], kind="stable")
    left = boxes[order, 0]
    slack = (1 - density.duplicate_overlap) * (boxes[:, 2] - boxes[:, 0])
    first = np.searchsorted(left, boxes[:, 0])
    counts = np.searchsorted(left, boxes[:, 0] + slack, "right") - first
    ends = np.cumsum(counts)
    found = np.zeros(len(scene), np.bool_)
    total = int(counts.sum())
    for start in range(0, total, PAIRS_AT_ONCE):
        pair = np.arange(start, min(start + PAIRS_AT_ONCE, total))
        i = np.searchsorted(ends, pair, "right")
        j = order[first[i] + pair - (ends - counts)[i]]
        alike = (i != j) & _alike(boxes, scene.colors, density, i, j)
        found[np.minimum(i, j)[alike]] = True
    return found


def _alike(
    boxes: FloatArray, colors: FloatArray, density: Density, i: IndexArray, j: IndexArray
) -> BoolArray:
    """Of pairs of shapes, whether they have nearly the same box and colour."""
    sizes = np.maximum(1e-6, (boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    low, high = np.maximum(boxes[i, :2], boxes[j, :2]), np.minimum(boxes[i, 2:], boxes[j, 2:])
    common = np.clip(high - low, 0, None).prod(axis=1)
    overlap = common / (sizes[i] + sizes[j] - common)
    apart = np.linalg.norm(colors[j] - colors[i], axis=1)
    return np.asarray((overlap > density.duplicate_overlap) & (apart < density.duplicate_color))


def prune_mask(scene: Scene, density: Density, progress: float) -> BoolArray:
    """True for the shapes to remove: faint, tiny, broken or doubled."""
    doomed = scene.opacities + scene.fades.mean(axis=1) < opacity_threshold(density, progress)
    # A small canvas with many shapes has no room for shapes of the usual least area.
    share = scene.canvas.width * scene.canvas.height / max(len(scene), 1)
    doomed |= areas(scene) < min(density.area, 0.1 * share)
    broken = ~np.isfinite(scene.points).all(axis=1)
    doomed |= np.logical_or.reduceat(broken, scene.first[:-1]) if len(scene) else doomed
    doomed |= duplicates(scene, density)
    return doomed


def least_seen(doomed: BoolArray, count: int, seen: FloatArray) -> IndexArray:
    """The ``count`` shapes to remove: the doomed first, then those with the least ``seen``."""
    rank = np.lexsort((seen, ~doomed))
    return np.asarray(rank[: max(count, int(doomed.sum()))])


@dataclass(frozen=True)
class _Candidates:
    """Places for new shapes."""

    centres: FloatArray
    """[px], shape (candidate, 2)."""
    radii: FloatArray
    """Of a fill, a circle [px]."""
    masses: FloatArray
    """The error that a shape covers."""
    angles: FloatArray
    """Of a stroke [rad]."""
    lengths: FloatArray
    """Of a stroke [px]; 0 for a fill."""
    widths: FloatArray
    """Of a stroke [px]."""

    @staticmethod
    def joined(parts: Sequence[_Candidates]) -> _Candidates:
        """All of them."""
        return _Candidates(
            *(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(_Candidates))
        )


def _candidates(error: FloatArray, *, mixed: bool) -> _Candidates:
    """Components of the error map's level sets.

    A component is stood for by its largest inscribed circle: a new shape there covers error only, however
    branched the component is. Or, if shapes may be ``mixed``, by a stroke, where that covers more of it.
    """
    top = max(float(np.quantile(error, 0.995)), 1e-12)
    found = []
    for level in range(1, ERROR_LEVELS):
        inside = error >= top * level / ERROR_LEVELS
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
        lines: list[npt.NDArray[Any]] = [np.zeros(len(radius))] * 3
        if mixed:
            streaks = Streaks.of(*np.divmod(pixel, error.shape[1]), label, number)
            long = streaks.stand_for(share)
            share = np.where(long, streaks.shares, share)
            centre = np.where(long[:, None], streaks.centres, centre)
            lines = [streaks.angles, np.where(long, streaks.lengths, 0.0), streaks.widths]
        arrays = (centre, radius, mass * share, *lines)
        found.append(_Candidates(*(np.asarray(array, np.float32) for array in arrays)))
    return _Candidates.joined(found)


def densify(
    settings: Settings,
    scene: Scene,
    target: FloatArray,
    image: FloatArray,
    count: int,
    rng: np.random.Generator,
    weights: FloatArray | None = None,
) -> Scene:
    """``count`` new shapes on the components of the quantised error map, the largest error first.

    ``target`` and ``image`` are (height, width, 3 or 4) at any one size, ``weights`` of their pixels (height,
    width), without all 1; the result is in canvas units.
    """
    unit = scene.canvas.width / target.shape[1]
    total = squares(image - target)
    weighted = total if weights is None else weights * total
    error = np.asarray(filters.gaussian_blur(weighted, 1.0), np.float32)
    found = _candidates(error, mixed=settings.mixed)
    chosen: list[int] = []
    taken = np.zeros(error.shape, np.uint8)
    for i in np.argsort(-found.masses, kind="stable"):
        if len(chosen) == count:
            break
        x, y = int(found.centres[i, 0]), int(found.centres[i, 1])
        if not taken[y, x]:
            chosen.append(int(i))
            _take(taken, found, int(i))
    places, sizes = found.centres[chosen], np.maximum(NEW_RADIUS * found.radii[chosen], 1.5)
    lengths = np.zeros(count, np.float32)
    lengths[: len(chosen)] = found.lengths[chosen]
    missing = count - len(chosen)
    if missing > 0:
        weight = error.ravel().astype(np.float64) + 1e-12
        picked = rng.choice(len(weight), missing, p=weight / weight.sum())
        row, column = np.divmod(picked, target.shape[1])
        places = np.concatenate([places, np.stack([column + 0.5, row + 0.5], axis=1)]).astype(np.float32)
        sizes = np.concatenate([sizes, np.full(missing, 2.0, np.float32)])
    column, row = pixel_of(places, target)
    tones = straight(np.asarray(filters.gaussian_blur(target, 1.0)[row, column], np.float32))
    angles = shape_angles(settings, target, places, 2.0)
    shapes = place(settings, scene.canvas, places * unit, np.pi * (sizes * unit) ** 2, angles, tones)
    long = np.flatnonzero(lengths)
    if not len(long):
        return shapes
    picked = np.array(chosen)[long]
    strokes = place_strokes(
        settings,
        scene.canvas,
        places[long] * unit,
        lengths[long] * unit,
        np.maximum(found.widths[picked], 1.0) * unit,
        found.angles[picked],
        tones[long],
    )
    order = np.arange(count)
    order[long] = count + np.arange(len(long))
    return shapes.append(strokes).take(order)


def _take(taken: npt.NDArray[np.uint8], found: _Candidates, i: int) -> None:
    """Mark what the shape of a candidate covers."""
    x, y = int(found.centres[i, 0]), int(found.centres[i, 1])
    if not found.lengths[i]:
        cv2.circle(taken, (x, y), max(1, round(float(found.radii[i]))), 1, -1)
        return
    angle, half = float(found.angles[i]), float(found.lengths[i]) / 2
    dx, dy = round(half * float(elementary.cos(angle))), round(half * float(elementary.sin(angle)))
    cv2.line(taken, (x - dx, y - dy), (x + dx, y + dy), 1, max(1, round(float(found.widths[i]))))
