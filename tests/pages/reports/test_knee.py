"""The knee of a curve."""

from __future__ import annotations

import numpy as np
import pytest

from warpsplat.pages.reports.knee import knee


def test_a_corner_is_the_knee() -> None:
    assert knee(np.array([1.0, 2, 3, 13]), np.array([0.0, 5, 9, 10])) == 2


def test_of_a_logarithm_it_lies_where_the_slope_is_the_mean() -> None:
    x = np.linspace(16, 1024, 4001)
    at = knee(x, 3 * np.log2(x) + 7)
    assert at is not None
    assert x[at] == pytest.approx((1024 - 16) / np.log(1024 / 16), rel=0.01)


@pytest.mark.parametrize("gain", [[1.0, 2, 3], [1.0, 1.2, 4], [3.0, 4, 2], [1.0, 1, 1]])
def test_there_may_be_none(gain: list[float]) -> None:
    """Of a line, of one that rises ever faster, of one that falls, and of one that stays."""
    assert knee(np.array([1.0, 2, 3]), np.array(gain)) is None


def test_two_points_have_none() -> None:
    assert knee(np.array([1.0, 2]), np.array([1.0, 2])) is None
