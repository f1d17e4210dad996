"""Which shapes go and where new ones come (paper section 3.4 and appendix B)."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares, straight
from warpsplat.fit.place import pixel_of, place, shape_angles
from warpsplat.fit.schedule import opacity_threshold
from warpsplat.fit.settings import Density, Settings
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


def _candidates(error: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Components of the error map's level sets: (centres [n, 2], radii [n], error inside [n]), in pixels.

    A component is stood for by its largest inscribed circle: a new shape there covers error only, however
    branched the component is.
    """
    top = max(float(np.quantile(error, 0.995)), 1e-12)
    centres, radii, masses = [], [], []
    for level in range(1, ERROR_LEVELS):
        inside = error >= top * level / ERROR_LEVELS
        mask = inside.view(np.uint8)
        number, labels = cv2.connectedComponents(mask, connectivity=4)
        # Padded, so that the border of the image bounds a circle as well.
        depth = cv2.distanceTransform(np.pad(mask, 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
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
        centres.append(np.stack([column + 0.5, row + 0.5], axis=1))
        radii.append(radius)
        masses.append(mass * np.minimum(1.0, np.pi * radius**2 / size))
    return tuple(np.concatenate(x).astype(np.float32) for x in (centres, radii, masses))  # type: ignore[return-value]


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
    error = np.asarray(cv2.GaussianBlur(weighted, (0, 0), 1.0), np.float32)
    centres, radii, masses = _candidates(error)
    chosen: list[int] = []
    taken = np.zeros(error.shape, np.uint8)
    for i in np.argsort(-masses, kind="stable"):
        if len(chosen) == count:
            break
        x, y = int(centres[i, 0]), int(centres[i, 1])
        if not taken[y, x]:
            chosen.append(int(i))
            cv2.circle(taken, (x, y), max(1, round(float(radii[i]))), 1, -1)
    places, sizes = centres[chosen], np.maximum(NEW_RADIUS * radii[chosen], 1.5)
    missing = count - len(chosen)
    if missing > 0:
        weight = error.ravel().astype(np.float64) + 1e-12
        picked = rng.choice(len(weight), missing, p=weight / weight.sum())
        row, column = np.divmod(picked, target.shape[1])
        places = np.concatenate([places, np.stack([column + 0.5, row + 0.5], axis=1)]).astype(np.float32)
        sizes = np.concatenate([sizes, np.full(missing, 2.0, np.float32)])
    column, row = pixel_of(places, target)
    tones = straight(np.asarray(cv2.GaussianBlur(target, (0, 0), 1.0)[row, column], np.float32))
    angles = shape_angles(settings, target, places, 2.0)
    return place(settings, scene.canvas, places * unit, np.pi * (sizes * unit) ** 2, angles, tones)
