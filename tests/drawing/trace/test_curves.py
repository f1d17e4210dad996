"""Lines, cubics, corners."""

from __future__ import annotations

import numpy as np
import pytest

from warpsplat.drawing.trace.beziers import points_at
from warpsplat.drawing.trace.corners import find_corners
from warpsplat.drawing.trace.curves import Pieces, areas_of, fit_circles, fit_polylines
from warpsplat.drawing.trace.grids import Floats
from warpsplat.drawing.trace.polylines import Polylines
from warpsplat.drawing.trace.spans import Polyline


def noise(*shape: int) -> Floats:
    """Standard deviation 0.02 px, whatever was drawn before."""
    return np.random.default_rng(0).normal(0, 0.02, shape)


def ring(radius: float, count: int = 200, squeeze: float = 1.0, turn: float = 0.0) -> Floats:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    points = radius * np.stack([np.cos(angle), squeeze * np.sin(angle)], axis=1)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return np.asarray(points @ rotation.T + 50)


def polygon(corners: Floats, step: float = 1.0) -> Floats:
    """Points along a closed polygon, none at its corners."""
    parts = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = int(np.hypot(*(b - a)) / step)
        parts.append(a + (b - a) * ((np.arange(count) + 0.5) / count)[:, None])
    return np.concatenate(parts)


def sampled(cubics: Floats, count: int = 40) -> Floats:
    return points_at(cubics, np.linspace(0, 1, count)).reshape(-1, 2)


def fitted(points: Floats, tolerance: float = 0.2) -> Pieces:
    (pieces,) = fit_polylines([Polyline(points, closed=True)], [tolerance])
    assert np.allclose(pieces.cubics[:, 3], np.roll(pieces.cubics[:, 0], -1, axis=0), atol=1e-6), "no gaps"
    return pieces


def count_corners(points: Floats) -> int:
    return len(find_corners(Polylines([points], [True]), np.ones(1)).along)


@pytest.mark.parametrize("radius", [3.0, 12.0, 40.0])
def test_a_circle_is_four_cubics(radius: float) -> None:
    points = ring(radius) + noise(200, 2)
    pieces = fitted(points)
    assert len(pieces.cubics) == 4 and not pieces.lines.any()
    assert np.abs(np.hypot(*(sampled(pieces.cubics) - 50).T) - radius).max() < 0.03
    ends = pieces.cubics[:, 0] - pieces.cubics[:, 0].mean(axis=0)
    assert (np.abs(ends) < 1e-6).any(axis=1).all(), "its nodes are where it is upright or level"


def test_circles_keep_their_way_round_and_squares_and_ellipses_are_none() -> None:
    square = polygon(np.array([(0, 0), (20, 0), (20, 20), (0, 20)], float))
    found = fit_circles([square, ring(20), ring(20)[::-1], ring(20, squeeze=0.9), square[:4]], 0.2)
    assert sorted(found) == [1, 2]
    one, other = areas_of(np.stack([sampled(found[number]) for number in (1, 2)]))
    assert one > 1250 and abs(one + other) < 1e-6


def test_a_polygon_is_lines_between_its_corners() -> None:
    corners = np.array([(10, 10), (60, 14), (40, 30), (70, 60), (12, 50)], float)
    pieces = fitted(polygon(corners) + noise(len(polygon(corners)), 2))
    assert pieces.lines.all() and len(pieces.cubics) == 5
    found = pieces.cubics[:, 0]
    off = np.hypot(*(found[:, None] - corners[None]).transpose(2, 0, 1)).min(axis=1)
    assert off.max() < 0.3, "0.05 as a rule, 0.13 at most, of sixty such noises"
    thirds = pieces.cubics[:, 0] + (pieces.cubics[:, 3] - pieces.cubics[:, 0]) / 3
    assert np.allclose(pieces.cubics[:, 1], thirds)


def test_a_rounded_square_is_lines_and_arcs() -> None:
    side, radius = 60.0, 15.0
    angle = np.linspace(0, np.pi / 2, 24)
    parts = []
    for k, center in enumerate([(45, 45), (15, 45), (15, 15), (45, 15)]):
        turned = angle + k * np.pi / 2
        parts.append(np.array(center) + radius * np.stack([np.cos(turned), np.sin(turned)], axis=1))
        start = parts[-1][-1]
        way = np.array([(-1, 0), (0, -1), (1, 0), (0, 1)][k])
        parts.append(start + way * np.arange(1, side - 2 * radius)[:, None])
    pieces = fitted(np.concatenate(parts))
    assert pieces.lines.sum() == 4
    assert len(pieces.cubics) <= 10
    assert count_corners(np.concatenate(parts)) == 0


def test_stairs_and_small_circles() -> None:
    """A circle of 3 px radius turns everywhere and has no corner; each step of a stair has one."""
    assert count_corners(ring(3.0, 20)) == 0
    stair = np.array([(0, 0), (8, 0), (8, 8), (16, 8), (16, 16), (0, 16)], float)
    assert count_corners(polygon(stair)) == 6


def test_open_runs_end_where_they_are_told_to() -> None:
    x = np.arange(1.0, 40)
    points = np.stack([x, 10 * np.sin(x / 12)], axis=1)
    start, end = np.array([0.0, 0.0]), np.array([40.0, 10 * np.sin(40 / 12)])
    (pieces,) = fit_polylines([Polyline(points, False, start, end)], [0.2])
    assert np.allclose(pieces.cubics[0, 0], start) and np.allclose(pieces.cubics[-1, 3], end)
    assert len(pieces.cubics) <= 3
    shown = sampled(pieces.cubics, 200)
    assert np.hypot(*(points[:, None] - shown[None]).transpose(2, 0, 1)).min(axis=1).max() < 0.25


def test_many_runs_are_fitted_as_each_alone() -> None:
    rng = np.random.default_rng(1)
    star = np.array([(0, 0), (9, 30), (40, 41), (10, 50), (1, 80), (-9, 50), (-40, 40), (-11, 30)], float)
    runs = [Polyline(ring(9.0, 50, squeeze=0.7), closed=True), Polyline(polygon(star), closed=True)]
    for count in (2, 9, 60):
        points = np.cumsum(rng.normal(0, 1, (count, 2)), axis=0)
        runs += [Polyline(points[1:-1], False, points[0], points[-1]), Polyline(points, closed=True)]
    for alone, run in zip(fit_polylines(runs, [0.2] * len(runs)), runs, strict=True):
        (pieces,) = fit_polylines([run], [0.2])
        assert np.allclose(pieces.cubics, alone.cubics, atol=1e-9) and (pieces.lines == alone.lines).all()
