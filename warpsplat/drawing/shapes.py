"""Outlines that the image shows no different from circles, ellipses and rectangles become just that.

All of them are boxes whose corners are quarters of ellipses; the nearest ones to many outlines are found at
once, by least squares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing import prices
from warpsplat.drawing.changes import MOST_OFF, Alternative, contour_change
from warpsplat.drawing.constraints import SAME_COORDINATE, Drawing, Floats, summed
from warpsplat.drawing.measure import Samples
from warpsplat.drawing.trace.contours import joints_of
from warpsplat.drawing.trace.curves import Pieces, areas_of
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import solve
from warpsplat.svg.primitives import Primitive

SAMPLES = 96
"""Places by which an outline is compared with a shape."""

ROUNDS = 8  # of Gauss and Newton's method
SMALL = 1e-4
"""Steps of numeric derivatives, least sizes [px], and added curvature, as a share, where an outline leaves a
size open."""

Boxes = Callable[[Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Family:
    """A kind of basic shape, by half its sides and the radii of its corners."""

    count: int
    """Number of its sizes."""
    boxes: Boxes
    """Half the sides and the radii, both (outline, 2), by the sizes (outline, size)."""

    @property
    def bytes(self) -> float:
        """Return the bytes of one of its shapes on a usual grid."""
        values = np.array([150.0, 150.0, 50.0, 40.0, 10.0])
        return prices.of_primitive(self.shape(values[: 2 + self.count]))

    def shape(self, values: Floats, *, is_clockwise: bool = True) -> Primitive:
        """Return the shape with a centre and sizes, shape (value,)."""
        half, radii = (x[0] for x in self.boxes(values[None, 2:]))
        (x, y), (a, b), (rx, ry) = values[:2].tolist(), half.tolist(), radii.tolist()
        return Primitive((x - a, y - b), (x + a, y + b), (rx, ry), is_clockwise)


def _box(sizes: Floats) -> tuple[Floats, Floats]:
    return sizes, np.zeros_like(sizes)


def _ellipse(sizes: Floats) -> tuple[Floats, Floats]:
    half = np.broadcast_to(sizes, (len(sizes), 2))
    return half, half


def _rounded(sizes: Floats) -> tuple[Floats, Floats]:
    half = sizes[:, :2]
    return half, np.repeat(np.minimum(sizes[:, 2:], half.min(axis=1, keepdims=True)), 2, axis=1)


FAMILIES = Family(2, _box), Family(1, _ellipse), Family(2, _ellipse), Family(3, _rounded)
"""Rectangles, circles, ellipses, and rectangles with round corners, by their bytes."""


def shape_changes(
    drawing: Drawing, samples: Samples, worth: float, over: Callable[[], bool] = bool
) -> list[Alternative]:
    """Return the basic shape of each contour that is near to one, the cheapest by error and bytes.

    Args:
        drawing: Fitted.
        samples: Where the image has its outlines.
        worth: Mean squared error that a byte is worth.
        over: Whether there is no time for more.
    """
    starts = np.searchsorted(drawing.contour()[samples.cubic], np.arange(len(drawing.scene.starts)))
    contours = np.flatnonzero(np.diff(drawing.scene.starts) >= 6)
    if not len(contours):
        return []
    first, count = starts[contours, None], np.diff(starts)[contours, None]
    chosen = first + np.floor((np.arange(SAMPLES) + 0.5) / SAMPLES * count).astype(np.intp)
    places, weights = samples.place[chosen], samples.weight[chosen] * count / SAMPLES
    areas, sizes = areas_of(places).astype(np.float64), _sizes(drawing)[contours]
    found: dict[int, Alternative] = {}
    least = np.full(len(contours), np.inf)
    for family in FAMILIES:
        if over():
            break
        values, off = nearest(family, places, weights)
        costs = (weights * np.minimum(off, MOST_OFF) ** 2).sum(axis=1) + worth * family.bytes
        costs[np.median(off, axis=1) > MOST_OFF] = np.inf  # what other shapes hide may be anywhere
        for i in np.flatnonzero(costs < least).tolist():
            made = family.shape(values[i], is_clockwise=bool(areas[i] > 0))
            found[i] = _change(drawing, int(contours[i]), made, float(sizes[i]) - family.bytes)
        least = np.minimum(least, costs)
    return [found[i] for i in sorted(found)]


def _change(drawing: Drawing, contour: int, made: Primitive, saved: float) -> Alternative:
    """Return the change of a contour to a basic shape."""
    cubics = made.cubics()
    level = np.abs(cubics[:, 3] - cubics[:, 0]) < SAME_COORDINATE
    joints = joints_of([Pieces(cubics, level[:, 0] | level[:, 1])])  # lines are level or upright
    return contour_change(drawing, {contour: (cubics[:, :3].reshape(-1, 2), joints)}, saved)


def _sizes(drawing: Drawing) -> Floats:
    """Return about the bytes of each contour."""
    cubics = drawing.cubics()
    is_level = np.abs(cubics[:, 3] - cubics[:, 0]).min(axis=1) < SAME_COORDINATE
    size = np.where(drawing.lines(), np.where(is_level, prices.LEVEL, prices.LINE), prices.CUBIC)
    return prices.MOVE + summed(drawing.contour(), size, len(drawing.scene.starts) - 1)


def distances(points: Floats, half: Floats, radii: Floats) -> Floats:
    """Return signed distances, about, of points from boxes around 0 with rounded corners.

    Args:
        points: Shape (outline, sample, 2).
        half: Half the sides, shape (outline, 2).
        radii: Shape (outline, 2).
    """
    beyond, radius = np.abs(points) - half[:, None], np.maximum(radii, SMALL)[:, None]
    from_center = np.maximum(beyond + radius, 0) / radius
    level = hypot(from_center[..., 0], from_center[..., 1])
    slopes = from_center / radius
    away = (level - 1) * level / np.maximum(hypot(slopes[..., 0], slopes[..., 1]), 1e-9)
    return np.where(level > 0, away, beyond.max(axis=2))


def nearest(family: Family, places: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return the shapes of a family nearest to most of the places of outlines, by weighted least squares.

    Places far off count little: another shape may hide what is there (Geman and McClure 1987).

    Returns:
        Centres and sizes, shape (outline, 2 + size), and distances, shape (outline, sample) [px].
    """
    low, high = places.min(axis=1), places.max(axis=1)
    center, half = (low + high) / 2, np.maximum((high - low) / 2, SMALL)
    least = half.min(axis=1, keepdims=True)
    sizes = np.concatenate([half, 0.5 * least], axis=1) if family.count > 1 else half.mean(1, keepdims=True)
    values = np.concatenate([center, sizes], axis=1)[:, : 2 + family.count]
    unit, size = np.eye(values.shape[1]), values[:, 2:].max(axis=1)

    def off(values: Floats) -> Floats:
        return distances(places - values[:, None, :2], *family.boxes(values[:, 2:]))

    for number in range(ROUNDS):
        reach = np.maximum(size / (2 << number), 1)
        here = off(values)
        slopes = np.stack([(off(values + SMALL * axis) - here) / SMALL for axis in unit])
        weighted = slopes * weights / (1 + (here / reach[:, None]) ** 2) ** 2
        system = np.stack([(weighted * slope).sum(axis=2) for slope in slopes]).transpose(2, 0, 1)
        stiffness = np.diagonal(system, axis1=1, axis2=2)
        damped = system + (SMALL * stiffness.sum(axis=1) + 1e-12)[:, None, None] * unit
        values = values - solve(damped, (weighted * here).sum(axis=2).T[..., None])[..., 0]
        values[:, 2:] = np.maximum(values[:, 2:], SMALL)
    return values, np.abs(off(values))
