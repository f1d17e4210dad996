"""One cubic in place of two."""

from __future__ import annotations

import numpy as np
import pytest

from warpsplat.drawing.trace.beziers import points_at
from warpsplat.drawing.trace.cubics import handles_through

CURVES = {
    "arc": [[0, 0], [0, 5.5], [4.5, 10], [10, 10]],
    "long": [[0, 0], [30, 2], [60, 30], [61, 50]],
    "wave": [[0, 0], [10, 12], [14, -9], [25, 3]],
    "flat": [[0, 0], [5, 0.1], [9, 0.1], [16, 0]],
}


def halves(cubic: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """A cubic in two at ``t``, by de Casteljau's rule."""
    rows = [cubic]
    while len(rows[-1]) > 1:
        rows.append(rows[-1][:-1] * (1 - t) + rows[-1][1:] * t)
    return np.stack([row[0] for row in rows]), np.stack([row[-1] for row in rows[::-1]])


@pytest.mark.parametrize("t", [0.2, 0.5, 0.7])
@pytest.mark.parametrize("name", CURVES)
def test_the_halves_of_a_cubic_are_one_again(name: str, t: float) -> None:
    cubic = np.array(CURVES[name], float)
    handles = handles_through(*halves(cubic, t))
    made = np.stack([cubic[0], *handles, cubic[3]])
    s = np.linspace(0, 1, 200)
    apart = np.linalg.norm(points_at(cubic, s)[:, None] - points_at(made, s), axis=2).min(axis=1)
    assert apart.max() < 0.02 * np.linalg.norm(cubic[3])


def test_it_begins_and_ends_as_they_do() -> None:
    """Whatever lies between, handles of length 0 included."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        first, second = rng.normal(0, 5, (2, 4, 2))
        second[0] = first[3]
        first[1] = first[0] if rng.integers(0, 2) else first[1]
        handles = handles_through(first, second)
        for handle, end, near in ((handles[0], first[0], first), (handles[1], second[3], second[::-1])):
            way = near[1] - near[0] if (near[1] != near[0]).any() else near[2] - near[0]
            turn = way[0] * (handle - end)[1] - way[1] * (handle - end)[0]
            assert abs(turn) < 1e-6 * np.linalg.norm(way) * (1 + np.linalg.norm(handle - end))
            assert way @ (handle - end) > 0


def test_many_at_once_are_as_each_alone() -> None:
    rng = np.random.default_rng(1)
    first, second = rng.normal(0, 5, (2, 30, 4, 2))
    second[:, 0] = first[:, 3]
    first[::5, 1] = first[::5, 0]
    first[7] = second[7] = 0
    alone = [handles_through(a, b) for a, b in zip(first, second, strict=True)]
    np.testing.assert_allclose(handles_through(first, second), alone, atol=1e-9)
