"""Steps of Gauss and Newton for outlines: the normal equations of their samples, by conjugate gradients."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.constraints import Floats, Freedom, Links, rows_of
from warpsplat.drawing.measure import Samples
from warpsplat.kernels.drawing import newton
from warpsplat.rendering.program import launch_on_host

ITERATIONS, CONVERGED = 60, 1e-4
"""Most steps of conjugate gradients, and the square of the residual, over the first, at which they end."""


class Equations:
    """The derivatives of the error of outlines: the second by cubics, the first by coordinates."""

    def __init__(self, samples: Samples, cubics: Floats, following: Links) -> None:
        """``cubics``: shape (cubic, 4, 2); ``following``: as ``Drawing.following``."""
        self.following, count = following, len(following)
        self.blocks, by_corner = np.zeros((count, 30)), np.zeros((count, 8))
        values = {"cubics": rows_of(cubics), "first": samples.starts(count), "gradient": by_corner}
        launch_on_host(newton.derivatives, count, samples, values, blocks=self.blocks)
        by_corner[following, :2] += by_corner[:, 6:]  # each cubic follows one other
        self.gradient = by_corner[:, :6].ravel()


def newton_step(
    equations: Equations, freedom: Freedom, gradient: Floats, damping: Floats, least: float
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
        equations,
        arrays,
        gradient=gradient,
        damping=damping,
        least=least,
        iterations=ITERATIONS,
        converged=CONVERGED,
    )
    return arrays["found"]
