from __future__ import annotations

import math

import pytest

from warpsplat.kernels import bezier, pixels


def test_modules_are_installed_under_the_package() -> None:
    assert pixels.tiles_to_pixels.module.name == "warpsplat.kernels.pixels"


@pytest.mark.parametrize("pieces", [1, 2, 7])
@pytest.mark.parametrize("t", [0.0, 0.3, 1.0])
def test_fair_weights_move_by_a_twelfth_of_the_second_difference(t: float, pieces: int) -> None:
    def bernstein(j: int, t: float) -> float:
        return math.comb(3, j) * (1 - t) ** (3 - j) * t**j

    step = 1 / pieces
    for j in range(4):
        around = [bernstein(j, t + side * step) for side in (-1, 0, 1)]
        want = around[1] - (around[0] - 2 * around[1] + around[2]) / 12
        assert bezier.fair_weights(t, pieces)[j] == pytest.approx(want, abs=1e-6)
