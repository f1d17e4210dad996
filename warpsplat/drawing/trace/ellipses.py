"""Circles and ellipses as four cubics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import determinant, eigh, product, solve
from warpsplat.scene.geometry import ARC_HANDLE
from warpsplat.scene.scene import starts_of

QUARTER = np.array([(1, 0), (1, ARC_HANDLE), (ARC_HANDLE, 1), (0, 1)])
TURN = np.array([(0, -1), (1, 0)])
LEAST_POINTS = 6  # that tell an ellipse from any other outline
DEPENDENT = 1e-20  # fraction of a column's square norm below which it depends on the columns before
LONGEST = 20  # axis of an ellipse, over its other one


def fit_ellipses(rings: Sequence[Floats], tolerance: float) -> tuple[Bools, Floats]:
    """Return which closed outlines (point, 2) are ellipses, and four cubics for each of these, (n, 4, 4, 2).

    ``tolerance``: about how far points may be from the ellipse [px].
    """
    counts = np.array([len(ring) for ring in rings], np.int64)
    found = counts >= LEAST_POINTS
    points = np.concatenate([*(ring for ring in rings if len(ring) >= LEAST_POINTS), np.zeros((0, 2))])
    counts = counts[found]
    if not len(counts):
        return found, np.zeros((0, 4, 4, 2))
    first = starts_of(counts)[:-1]
    owner = np.repeat(np.arange(len(counts)), counts)
    middle = np.add.reduceat(points, first) / counts[:, None]
    away = points - middle[owner]
    known, conic = _conics(away, first, owner)
    shape = conic[:, [0, 1, 1, 2]].reshape(-1, 2, 2) * [[1, 0.5], [0.5, 1]]
    values, vectors = eigh(shape)
    known &= (values[:, 0] > 1e-9) & (determinant(shape) > 0)
    shape, values = np.where(known[:, None, None], shape, np.eye(2)), np.where(known[:, None], values, 1.0)
    center = -0.5 * solve(shape, conic[:, 3:, None])
    level = 1 + (product(shape, center) * center).sum(axis=(1, 2))
    radii, center = np.sqrt(level[:, None] / values), center[..., 0]
    mean = np.sqrt(radii[:, 0] * radii[:, 1])
    limit = np.minimum(tolerance * (1 + 0.003 * mean), 0.12 * mean + 0.05)
    x, y = ((away - center[owner])[:, :, None] * (vectors / radii[:, None])[owner]).sum(axis=1).T
    off = np.abs(hypot(x, y) - 1) * radii.min(axis=1)[owner]
    known &= radii.max(axis=1) <= LONGEST * radii.min(axis=1)
    known &= np.maximum.reduceat(off, first) <= 1.5 * limit
    known &= np.sqrt(np.add.reduceat(off**2, first) / counts) <= 0.6 * limit
    is_circle = np.abs(radii[:, 0] - radii[:, 1]) < np.maximum(0.5 * tolerance, 0.004 * mean)
    # An ellipse begins at the upper or left end of its longer axis.
    vectors = np.where((shape[:, 0, 0] > shape[:, 1, 1])[:, None, None], -vectors, vectors)
    vectors = np.where(is_circle[:, None, None], np.eye(2), vectors)
    radii = np.where(is_circle[:, None], radii.mean(axis=1, keepdims=True), radii)
    after = np.arange(1, len(points) + 1)
    after[first + counts - 1] = first
    area = np.add.reduceat(away[:, 0] * away[after, 1] - away[after, 0] * away[:, 1], first)
    found[found] = known
    frames = vectors * radii[:, None]
    frames[..., 1] *= np.where((determinant(frames) < 0) != (area < 0), -1, 1)[:, None]
    return found, _cubics(frames[known], (middle + center)[known])


def _conics(points: Floats, first: Ints, owner: Ints) -> tuple[Bools, Floats]:
    """Fit conics A x^2 + B xy + C y^2 + D x + E y = 1 to points by orthogonalising its columns.

    Args:
        points: Of all outlines, shape (point, 2).
        first: First point of each outline, shape (outline,).
        owner: Outline of each point, shape (point,).

    Returns:
        Whether the points determine one, shape (outline,); the coefficients, shape (outline, 5).
    """
    x, y = points.T
    rest = np.stack([x * x, x * y, y * y, x, y, np.ones(len(x))])
    whole = np.add.reduceat(rest * rest, first, axis=1)
    known, shares = np.ones(len(first), np.bool_), np.zeros((5, 6, len(first)))
    for k in range(5):
        column = rest[k]
        square = np.add.reduceat(column * column, first)
        known &= square > DEPENDENT * whole[k]
        shares[k, k + 1 :] = np.add.reduceat(column * rest[k + 1 :], first, axis=1) / np.where(
            known, square, 1
        )
        rest[k + 1 :] -= shares[k, k + 1 :][:, owner] * column
    found = shares[:, 5].copy()
    for k in range(4, 0, -1):
        found[:k] -= shares[:k, k] * found[k]
    return known, found.T


def _cubics(frames: Floats, centers: Floats) -> Floats:
    """Return ellipses as cubics, (n, 4, 4, 2), from their axes (columns), (n, 2, 2), and centres (n, 2)."""
    quarters = [QUARTER]
    for _ in range(3):
        quarters.append(product(quarters[-1], TURN.T))
    flat = np.swapaxes(frames, 1, 2)[:, None]
    return product(np.stack(quarters), flat) + centers[:, None, None]
