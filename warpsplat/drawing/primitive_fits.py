"""The nearest circles, ellipses and rectangles to outlines, by least squares, for many outlines at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.drawing import prices
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import solve
from warpsplat.svg.primitives import Primitive

Floats = npt.NDArray[np.float64]

ROUNDS = 12  # of Gauss and Newton's method
STEP = 1e-4  # [px] of numeric derivatives of boxes by sizes
DAMPING = 1e-6  # of the squared derivatives, where an outline leaves a parameter open
LEAST_SIZE = 0.25  # [px] half a side, or a radius, at the least
REACH = 0.5  # [half the size] at first, [px] in the end: samples farther off count little


class OutlinePoints(NamedTuple):
    """Points of outlines with equally many of them."""

    points: Floats
    """Shape (outline, sample, 2) [px]."""
    weights: Floats
    """By which squared distances count: what a distance costs in the image, shape (outline, sample)."""

    def take(self, rows: npt.NDArray[np.intp]) -> OutlinePoints:
        """Return those of some outlines."""
        return OutlinePoints(self.points[rows], self.weights[rows])


Boxes = Callable[[Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Family:
    """A kind of basic shape, by half its sides and the radii of its corners."""

    count: int
    """Number of its free values: the centre's two coordinates first, then sizes."""
    size: float
    """About its bytes in a file."""
    boxes: Boxes
    """Half the sides and the radii, both (outline, 2), by the free sizes (outline, size)."""


def _circle(sizes: Floats) -> tuple[Floats, Floats]:
    half = np.repeat(sizes, 2, axis=1)
    return half, half


def _rounded(sizes: Floats) -> tuple[Floats, Floats]:
    half = sizes[:, :2]
    return half, np.repeat(np.minimum(sizes[:, 2:], half.min(axis=1, keepdims=True)), 2, axis=1)


def _priced(count: int, boxes: Boxes) -> Family:
    """Return a family with the bytes of one of its shapes on a usual grid."""
    typical = np.array([[50.0, 40.0, 10.0]])[:, : count - 2]
    (a, b), (rx, ry) = (x[0].tolist() for x in boxes(typical))
    return Family(
        count, prices.of_primitive(Primitive((150 - a, 150 - b), (150 + a, 150 + b), (rx, ry))), boxes
    )


FAMILIES = (
    _priced(4, lambda sizes: (sizes, np.zeros_like(sizes))),
    _priced(3, _circle),
    _priced(4, lambda sizes: (sizes, sizes)),
    _priced(5, _rounded),
)
"""Rectangles, circles, ellipses, and rectangles with round corners, by their bytes."""


def distances_and_slopes(points: Floats, half: Floats, radii: Floats) -> tuple[Floats, Floats]:
    """Return signed distances, about, of points from boxes around 0 with rounded corners; their derivatives.

    These have shape (5, outline, sample): by the coordinates' amounts, half the sides, and the radius.

    Args:
        points: Shape (outline, sample, 2).
        half: Half the sides, shape (outline, 2).
        radii: Shape (outline, 2); unequal ones only of ellipses.
    """
    x, y = np.abs(points[..., 0]), np.abs(points[..., 1])
    a, b = half[:, :1], half[:, 1:]
    is_ellipse = (radii == half).all(axis=1, keepdims=True)
    found: list[tuple[Floats, Floats]] = []
    if is_ellipse.any():
        u, v = x / a, y / b
        level = np.maximum(hypot(u, v), 1e-9)
        slope = np.maximum(hypot(u / a, v / b), 1e-9)
        across = np.stack([u / a, v / b]) / (level * slope)
        slopes = np.concatenate([across, -across * np.stack([u, v]), np.zeros_like(x)[None]])
        found.append(((level - 1) * level / slope, slopes))
    if not is_ellipse.all():
        r = radii[:, :1]
        u, v = x - (a - r), y - (b - r)
        outside = np.maximum(np.stack([u, v]), 0)
        away = hypot(*outside)
        nearer = np.stack([u >= v, u < v])
        across = np.where(away > 0, outside / np.maximum(away, 1e-9), nearer)
        slopes = np.concatenate([across, -across, across.sum(axis=0)[None] - 1])
        found.append((away + np.minimum(np.maximum(u, v), 0) - r, slopes))
    (off, slopes), (other_off, other_slopes) = found[0], found[-1]
    return np.where(is_ellipse, off, other_off), np.where(is_ellipse, slopes, other_slopes)


class Fits(NamedTuple):
    """The nearest shapes of a family."""

    values: Floats
    """Shape (outline, value) [px]."""
    off: Floats
    """Distances of the samples, shape (outline, sample) [px]."""


def nearest(family: Family, samples: OutlinePoints) -> Fits:
    """Return the shapes of a family nearest to most of the samples, by weighted least squares.

    Samples far off count little: another shape may hide what is there (Geman and McClure 1987).
    """
    points, weights = samples
    values = _start(family, samples)
    size = values[:, 2:].max(axis=1)
    unit = np.eye(values.shape[1])

    def off(values: Floats) -> tuple[Floats, Floats]:
        """Return the distances, and their derivatives by the values, shape (value, outline, sample)."""
        half, radii = family.boxes(values[:, 2:])
        away = points - values[:, None, :2]
        here, (across_x, across_y, *by_box) = distances_and_slopes(away, half, radii)
        slopes = [-np.sign(away[..., 0]) * across_x, -np.sign(away[..., 1]) * across_y]
        for axis in unit[2:, 2:]:
            moved_half, moved_radii = family.boxes(values[:, 2:] + STEP * axis)
            moved = [*((moved_half - half) / STEP).T, ((moved_radii - radii) / STEP)[:, 0]]
            slopes.append(sum(share[:, None] * slope for share, slope in zip(moved, by_box, strict=True)))
        return here, np.stack(slopes)

    for number in range(ROUNDS):
        reach = np.maximum(REACH * size / (1 << number), REACH if number else 0)
        here, slopes = off(values)
        trust = weights / (1 + (here / reach[:, None]) ** 2) ** 2
        weighted = slopes * trust
        system = np.stack([(weighted * slope).sum(axis=2) for slope in slopes]).transpose(2, 0, 1)
        stiffness = np.diagonal(system, axis1=1, axis2=2)
        damped = system + (DAMPING * stiffness.sum(axis=1) + 1e-12)[:, None, None] * unit
        values = values - solve(damped, (weighted * here).sum(axis=2).T[..., None])[..., 0]
        values[:, 2:] = np.maximum(values[:, 2:], LEAST_SIZE)
    return Fits(values, off(values)[0])


def _start(family: Family, samples: OutlinePoints) -> Floats:
    """Return centres and sizes from the samples' boxes, shape (outline, value)."""
    low, high = samples.points.min(axis=1), samples.points.max(axis=1)
    center, half = (low + high) / 2, np.maximum((high - low) / 2, LEAST_SIZE)
    least = half.min(axis=1, keepdims=True)
    sizes = np.concatenate([half, 0.5 * least], axis=1) if family.count > 3 else half.mean(1, keepdims=True)
    return np.concatenate([center, sizes], axis=1)[:, : family.count]


def shape_of(family: Family, values: Floats, *, is_clockwise: bool) -> Primitive:
    """Return the shape with some values, shape (value,)."""
    half, radii = (x[0] for x in family.boxes(values[None, 2:]))
    (x, y), (a, b), (rx, ry) = values[:2].tolist(), half.tolist(), radii.tolist()
    return Primitive((x - a, y - b), (x + a, y + b), (rx, ry), is_clockwise)


def areas(family: Family, values: Floats) -> Floats:
    """Return the areas of shapes [px²]."""
    half, radii = family.boxes(values[:, 2:])
    return np.asarray(4 * half.prod(axis=1) - (4 - np.pi) * radii.prod(axis=1))
