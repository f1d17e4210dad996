from __future__ import annotations

import pytest

from warpsplat.kernels import bezier
from warpsplat.kernels.grid import gaussians


def test_weights() -> None:
    for t in (0.0, 0.3, 1.0):
        weights = bezier.cubic_weights(t)
        tangent = bezier.cubic_tangent_weights(t)
        assert sum(weights) == pytest.approx(1, abs=1e-6)
        assert sum(tangent) == pytest.approx(0, abs=1e-6)
        step = 1e-3
        for j in range(4):
            around = (bezier.cubic_weights(t + step)[j] - bezier.cubic_weights(t - step)[j]) / (2 * step)
            assert tangent[j] == pytest.approx(around, abs=1e-3)


def test_modules_are_installed_under_the_package() -> None:
    assert gaussians.gaussians_forward.module.name == "warpsplat.kernels.grid.gaussians"
