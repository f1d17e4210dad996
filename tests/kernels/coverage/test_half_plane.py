from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from warpsplat.kernels.coverage.stroke import half_plane, half_plane_slope


def test_half_plane() -> None:
    """The closed form against counting points of a fine grid; its slope against differences."""
    grid = (np.arange(400) + 0.5) / 400 - 0.5
    x, y = np.meshgrid(grid, grid)
    for angle in (0, 0.2, np.pi / 4, 1.3, 2.5, 4.0):
        n = wp.vec2(np.cos(angle), np.sin(angle))
        for distance in (-0.8, -0.6, -0.3, 0.0, 0.2, 0.55, 0.71):
            counted = (n[0] * x + n[1] * y < distance).mean()
            assert half_plane(distance, n) == pytest.approx(counted, abs=4e-3)
            around = (half_plane(distance + 1e-3, n) - half_plane(distance - 1e-3, n)) / 2e-3
            assert half_plane_slope(distance, n) == pytest.approx(around, abs=6e-3)
