"""Steps of Gauss and Newton for outlines: the normal equations of their samples, by conjugate gradients."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.constraints import Floats, Freedom, Links, summed
from warpsplat.drawing.measure import Samples, bernstein

ITERATIONS, CONVERGED = 60, 1e-4
"""Most steps of conjugate gradients, and the square of the residual, over the first, at which they end."""


class Bending:
    """The second derivative of the error of outlines, by cubics."""

    def __init__(self, samples: Samples, following: Links) -> None:
        """``following``: as ``Drawing.following``."""
        count = len(following)
        own = np.arange(6 * count).reshape(count, 6)
        self._rows = np.concatenate([own, own[following, :2]], axis=1).T
        self._size = 6 * count
        weights = bernstein(samples.t).T
        slopes = np.stack([weight * across for weight in weights for across in samples.across.T])
        self.slopes = slopes.T
        # Arrays have the cubics last: sums along short last axes take ten times as long.
        self._weighted = 2 * samples.weight * slopes
        self._blocks = np.zeros((8, 8, count))
        for i in range(8):
            for j in range(i + 1):
                sums = summed(samples.cubic, self._weighted[i] * slopes[j], count)
                self._blocks[i, j] = self._blocks[j, i] = sums
        self._samples = samples

    def times(self, change: Floats) -> Floats:
        """Return the change of the gradient by a change of the coordinates."""
        moved = (self._blocks * change[self._rows]).sum(axis=1)
        return summed(self._rows.ravel(), moved.ravel(), self._size)

    def diagonal(self) -> Floats:
        """Return the diagonal."""
        return self._sums(self._blocks[range(8), range(8)])

    def stiffness(self, factors: Floats) -> Floats:
        """Return ``factors``, by cubic, times the curvature of each point, the same in all directions.

        An outline that slides along itself costs nothing, but leads away.
        """
        own = self._blocks[range(8), range(8)].reshape(4, 2, -1).sum(axis=1) * factors
        return self._sums(np.repeat(own, 2, axis=0))

    def _sums(self, corners: Floats) -> Floats:
        """Return sums of numbers at the coordinates of the cubics' control points, shape (8, cubic)."""
        return summed(self._rows.ravel(), corners.ravel(), self._size)

    def error_and_gradient(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the errors of the samples, and the derivative of their sum by the coordinates."""
        s = self._samples
        corners = points.ravel()[self._rows].reshape(4, 2, -1)
        corners = (corners[..., s.cubic] * s.across.T).sum(axis=1)
        across = (bernstein(s.t).T * corners).sum(axis=0) - (s.place * s.across).T.sum(axis=0)
        count = self._rows.shape[1]
        gradient = np.stack([summed(s.cubic, own * across, count) for own in self._weighted])
        return s.weight * across**2, self._sums(gradient)


def newton_step(
    bending: Bending, freedom: Freedom, gradient: Floats, damping: Floats, least: float
) -> Floats:
    """Return the free numbers that lower the error most, if the curvature grows by a share ``damping``."""
    right = -freedom.adjoint(gradient)
    squared = freedom.value**2
    diagonal = summed(freedom.column, squared * bending.diagonal()[freedom.row], freedom.size)
    added = summed(freedom.column, squared * bending.stiffness(damping)[freedom.row], freedom.size)
    added = added + least
    diagonal = diagonal + added
    x = np.zeros_like(right)
    residual, way, size = right, np.zeros_like(right), 1.0
    for n in range(ITERATIONS):
        scaled = residual / diagonal
        found = float((residual * scaled).sum())
        if n == 0:
            first = found
        if found <= CONVERGED * first:
            break
        way = scaled + (found / size if n else 0.0) * way
        size = found
        pushed = freedom.adjoint(bending.times(freedom.times(way))) + added * way
        length = found / float((way * pushed).sum())
        x = x + length * way
        residual = residual - length * pushed
    return x
