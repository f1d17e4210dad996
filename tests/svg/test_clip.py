"""Cutting shapes at the borders of viewports."""

from __future__ import annotations

import numpy as np
import pytest

from warpsplat.svg.clip import _zeros, cut_subpath
from warpsplat.svg.paths import cubics


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ((-1, -1 / 3, 1 / 3, 1), [0.5]),  # straight
        ((-1, 1, -1, 1), [0.5]),  # flat where it crosses
        ((3, -1, -1, 3), []),  # touches
        ((-3, 1, 1, -3), []),
        ((0, 1, 1, 0), []),  # from end to end
        ((0, 0, 0, 0), []),
        ((1, 1, 1, 1), []),
    ],
)
def test_sign_changes_of_special_cubics(heights: tuple[float, ...], expected: list[float]) -> None:
    assert _zeros(*heights) == pytest.approx(expected, abs=1e-4)


def test_a_circle_cut_in_half() -> None:
    (circle,) = cubics("M0 5A5 5 0 0 1 10 5A5 5 0 0 1 0 5z", keep_dots=False)
    half = cut_subpath(circle, np.array([[-1.0, -1], [4, -1], [4, 11], [-1, 11]]))
    assert half is not None
    points = half.points[::3]
    assert points[:, 0].max() == pytest.approx(4)
    edge = np.sort(points[points[:, 0] > 4 - 1e-6, 1])
    assert edge[[0, -1]] == pytest.approx([5 - 24**0.5, 5 + 24**0.5], abs=2e-3)
