"""Cutting shapes at the borders of viewports."""

from __future__ import annotations

import numpy as np
import pytest

from warpsplat.svg.clip import _zeros, cut_subpath
from warpsplat.svg.paths import cubics


def test_sign_changes_of_cubics() -> None:
    rng = np.random.default_rng(0)
    for a, b, c, d in rng.uniform(-1, 1, (300, 4)):
        roots = np.roots([d - 3 * c + 3 * b - a, 3 * (c - 2 * b + a), 3 * (b - a), a])
        expected = sorted(t.real for t in roots if abs(t.imag) < 1e-9 and 0 < t.real < 1)
        assert _zeros(a, b, c, d) == pytest.approx(expected, abs=1e-6)


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
