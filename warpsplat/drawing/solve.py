"""Steps of Gauss and Newton for outlines: the normal equations of their samples, by conjugate gradients."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.constraints import Floats, Freedom, Links, rows_of
from warpsplat.drawing.measure import Samples
from warpsplat.kernels.drawing import newton
from warpsplat.rendering.program import launch_on_host

ITERATIONS, CONVERGED = 60, 1e-4
"""Most steps of conjugate gradients, and the square of the residual, over the first, at which they end."""

PAIRS = 30
"""Numbers of the second derivatives by pairs of a cubic's control points."""


class Bending:
    """The second derivative of the error of outlines, by cubics."""

    def __init__(self, samples: Samples, following: Links) -> None:
        """``following``: as ``Drawing.following``."""
        self._samples, self.following = samples, following
        self.count = len(following)
        self._first = samples.starts(self.count)
        self.blocks = np.zeros((self.count, PAIRS))
        launch_on_host(newton.curvature, self.count, samples, first=self._first, blocks=self.blocks)

    def gradient(self, cubics: Floats) -> Floats:
        """Return the derivative of the samples' error by the coordinates with which cubics begin."""
        by_corner = np.zeros((self.count, 8))
        values = {"cubics": rows_of(cubics), "first": self._first, "gradient": by_corner}
        launch_on_host(newton.slopes, self.count, self._samples, values)
        gradient = by_corner[:, :6].copy()
        gradient[self.following, :2] += by_corner[:, 6:]  # each cubic follows one other
        return gradient.ravel()


def newton_step(
    bending: Bending, freedom: Freedom, gradient: Floats, damping: Floats, least: float
) -> Floats:
    """Return the free numbers that lower the error most, if the curvature grows by a share ``damping``.

    Contours have no numbers in common, so that each is solved on its own.
    """
    scratch = "moved", "force", "residual", "way", "pushed", "diagonal", "added", "found"
    arrays = {name: np.zeros(freedom.size) for name in scratch}
    launch_on_host(
        newton.solve,
        len(freedom.contour_first) - 1,
        freedom,
        bending,
        arrays,
        gradient=gradient,
        damping=damping,
        least=least,
        iterations=ITERATIONS,
        converged=CONVERGED,
    )
    return arrays["found"]
