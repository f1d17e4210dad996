"""The nearest circles, ellipses and rectangles to outlines, by least squares, for many outlines at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import solve
from warpsplat.svg.primitives import Primitive

Floats = npt.NDArray[np.float64]

ROUNDS = 8  # of Gauss and Newton's method, which begins within a pixel of the minimum
STEP = 1e-4  # [px] of numeric derivatives
DAMPING = 1e-6  # of the squared derivatives, where an outline leaves a parameter open
LEAST_SIZE = 0.25  # [px] half a side, or a radius, at the least


class Samples(NamedTuple):
    """Points of outlines with equally many of them."""

    points: Floats
    """Shape (outline, sample, 2) [px]."""
    weights: Floats
    """By which squared distances count: what a distance costs in the image, shape (outline, sample)."""


@dataclass(frozen=True)
class Family:
    """A kind of basic shape, by half its sides and the radii of its corners."""

    name: str
    sizes: int
    """Free sizes besides the place of the centre."""
    size: int
    """About its bytes in a file."""
    boxes: Callable[[Floats], tuple[Floats, Floats]]
    """Half the sides and the radii, both (outline, 2), by the free sizes (outline, size)."""


def _circle(sizes: Floats) -> tuple[Floats, Floats]:
    half = np.repeat(sizes, 2, axis=1)
    return half, half


def _pill(sizes: Floats) -> tuple[Floats, Floats]:
    return sizes, np.repeat(sizes.min(axis=1, keepdims=True), 2, axis=1)


def _rounded(sizes: Floats) -> tuple[Floats, Floats]:
    half = sizes[:, :2]
    return half, np.repeat(np.minimum(sizes[:, 2:], half.min(axis=1, keepdims=True)), 2, axis=1)


FAMILIES = (
    Family("circle", 1, 38, _circle),
    Family("rectangle", 2, 22, lambda sizes: (sizes, np.zeros_like(sizes))),
    Family("ellipse", 2, 42, lambda sizes: (sizes, sizes)),
    Family("pill", 2, 50, _pill),
    Family("rounded", 3, 56, _rounded),
)
"""Their bytes are those of an element, which has as many as path data with arcs."""


def distances(points: Floats, half: Floats, radii: Floats) -> Floats:
    """Return signed distances, about, of points from boxes around 0 with rounded corners.

    Args:
        points: Shape (outline, sample, 2).
        half: Half the sides, shape (outline, 2).
        radii: Shape (outline, 2); unequal ones only of ellipses.
    """
    x, y = np.abs(points[..., 0]), np.abs(points[..., 1])
    a, b = half[:, :1], half[:, 1:]
    is_ellipse = (radii == half).all(axis=1, keepdims=True)
    level = np.maximum(hypot(x / a, y / b), 1e-9)
    slope = np.maximum(hypot(x / (a * a), y / (b * b)), 1e-9)
    r = radii[:, :1]
    u, v = x - (a - r), y - (b - r)
    boxed = hypot(np.maximum(u, 0), np.maximum(v, 0)) + np.minimum(np.maximum(u, v), 0) - r
    return np.where(is_ellipse, (level - 1) * level / slope, boxed)


class Fits(NamedTuple):
    """The nearest shapes of a family."""

    centers: Floats
    """Shape (outline, 2) [px]."""
    half: Floats
    """Half the sides, shape (outline, 2) [px]."""
    radii: Floats
    """Of the corners, shape (outline, 2) [px]."""
    off: Floats
    """Distances of the samples, shape (outline, sample) [px]."""

    def areas(self) -> Floats:
        """Return their areas, shape (outline,) [px²]."""
        return np.asarray(4 * self.half.prod(axis=1) - (4 - np.pi) * self.radii.prod(axis=1))

    def shape_of(self, outline: int, *, is_clockwise: bool) -> Primitive:
        """Return the shape of one outline."""
        low, high = self.centers[outline] - self.half[outline], self.centers[outline] + self.half[outline]
        ends = (tuple(values.tolist()) for values in (low, high, self.radii[outline]))
        return Primitive(*ends, is_clockwise)  # type: ignore[arg-type]  # pairs of floats


def nearest(family: Family, samples: Samples) -> Fits:
    """Return the shapes of a family with the least weighted squares of the samples' distances."""
    points, weights = samples
    values = _start(family, samples)

    def off(values: Floats) -> Floats:
        half, radii = family.boxes(values[:, 2:])
        return distances(points - values[:, None, :2], half, radii)

    count = values.shape[1]
    for _ in range(ROUNDS):
        here = off(values)
        slopes = np.stack([(off(values + STEP * unit) - here) / STEP for unit in np.eye(count)], axis=2)
        weighted = slopes * weights[..., None]
        system = np.stack([(weighted * slopes[..., k, None]).sum(axis=1) for k in range(count)], axis=1)
        scale = np.trace(system, axis1=1, axis2=2)[:, None, None] / count + 1e-12
        system += DAMPING * scale * np.eye(count)
        values = values - solve(system, (weighted * here[..., None]).sum(axis=1)[..., None])[..., 0]
        values[:, 2:] = np.maximum(values[:, 2:], LEAST_SIZE)
    half, radii = family.boxes(values[:, 2:])
    return Fits(values[:, :2], half, radii, off(values))


def _start(family: Family, samples: Samples) -> Floats:
    """Return centres and sizes from the samples' boxes, shape (outline, value)."""
    seen = samples.weights > 0
    low = np.where(seen[..., None], samples.points, np.inf).min(axis=1)
    high = np.where(seen[..., None], samples.points, -np.inf).max(axis=1)
    center, half = (low + high) / 2, np.maximum((high - low) / 2, LEAST_SIZE)
    if family.sizes == 1:
        return np.concatenate([center, half.mean(axis=1, keepdims=True)], axis=1)
    corner = 0.5 * half.min(axis=1, keepdims=True)
    return np.concatenate([center, half, corner][: family.sizes], axis=1)
