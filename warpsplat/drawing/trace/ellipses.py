"""Circles and ellipses as four cubics."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import eigh, lstsq, product, solve
from warpsplat.scene.geometry import ARC_HANDLE


def fit_ellipse(points: Floats, tolerance: float) -> Floats | None:
    """Return four cubics, shape (4, 4, 2), if a closed outline (point, 2) is an ellipse; else None.

    Args:
        points: Shape (point, 2).
        tolerance: About how far they may be from the ellipse [px].
    """
    if len(points) < 6:
        return None
    middle = points.mean(axis=0)
    away = points - middle
    x, y = away.T
    # A conic through the points: A x^2 + B xy + C y^2 + D x + E y = 1.
    conic = lstsq(np.stack([x * x, x * y, y * y, x, y], axis=1), np.ones(len(points)))
    shape = np.array([[conic[0], conic[1] / 2], [conic[1] / 2, conic[2]]])
    values, vectors = eigh(shape)
    if values.min() <= 1e-9:
        return None
    center = -0.5 * solve(shape, conic[3:])
    level = 1 + (product(shape, center) * center).sum()
    radii = np.sqrt(level / values)
    if radii.max() > 20 * radii.min():
        return None
    mean = float(np.sqrt(radii.prod()))
    limit = min(tolerance * (1 + 0.003 * mean), 0.12 * mean + 0.05)
    off = np.abs(hypot(*(product(away - center, vectors) / radii).T) - 1) * radii.min()
    if off.max() > 1.5 * limit or np.sqrt((off**2).mean()) > 0.6 * limit:
        return None
    if abs(radii[0] - radii[1]) < max(0.5 * tolerance, 0.004 * mean):
        vectors, radii = np.eye(2), np.full(2, radii.mean())
    elif shape[0, 0] > shape[1, 1]:  # so that it begins at the upper or left end of its longer axis
        vectors = -vectors
    frame = vectors * radii
    if frame[0, 0] * frame[1, 1] < frame[0, 1] * frame[1, 0]:
        frame[:, 1] *= -1
    following = np.roll(points, -1, axis=0)
    if (points[:, 0] * following[:, 1] - following[:, 0] * points[:, 1]).sum() < 0:
        frame[:, 1] *= -1
    quarter = np.array([(1, 0), (1, ARC_HANDLE), (ARC_HANDLE, 1), (0, 1)])
    turn = np.array([(0, -1), (1, 0)])
    cubics = []
    for _ in range(4):
        cubics.append(product(quarter, frame.T) + middle + center)
        quarter = product(quarter, turn.T)
    return np.stack(cubics)
