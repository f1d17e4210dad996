"""The planar map, its sub-pixel places, and the lines and cubics along it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.trace.drawings import draw, draw_exactly, ground, levels
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.drawing.trace.cubics import handles_through
from warpsplat.drawing.trace.curves import fit_polylines
from warpsplat.drawing.trace.grids import NO_REGION, Floats, components
from warpsplat.drawing.trace.label_map import LabelMap
from warpsplat.drawing.trace.outlines import find_boundary
from warpsplat.drawing.trace.partition import find_partition
from warpsplat.drawing.trace.planar import find_loops
from warpsplat.drawing.trace.regions import find_regions
from warpsplat.drawing.trace.spans import Polyline


def ring(radius: float, count: int = 200, squeeze: float = 1.0) -> Floats:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.asarray(50 + radius * np.stack([np.cos(angle), squeeze * np.sin(angle)], axis=1))


@pytest.mark.parametrize("radius", [3.0, 12.0, 40.0])
def test_a_circle_is_four_cubics(radius: float) -> None:
    points = ring(radius) + np.random.default_rng(0).normal(0, 0.02, (200, 2))
    (pieces,) = fit_polylines([Polyline(points, closed=True)], [0.2])
    starts, ends = pieces.cubics[:, 0], pieces.cubics[:, 3]
    assert np.allclose(ends, np.roll(starts, -1, axis=0), atol=1e-6), "no gaps"
    assert len(starts) == 4 and not pieces.lines.any()
    drawn = points_at(pieces.cubics, np.linspace(0, 1, 40)).reshape(-1, 2)
    assert np.abs(np.hypot(*(drawn - 50).T) - radius).max() < 0.03
    off = np.abs(starts - starts.mean(axis=0))
    assert (off < 1e-6).any(axis=1).all(), "its nodes are where it is upright or level"


@pytest.mark.parametrize("middle", [95.0, 100.0, 110.0])
def test_a_bulge_of_a_long_line_is_kept(middle: float) -> None:
    """The places at which a curve as long as the line is measured at first may all be beside it."""
    x = np.arange(0.5, 400)
    y = 10 + np.exp(-(((x - middle) / 4) ** 2))
    run = Polyline(np.stack([x, y], axis=1), False, np.array([0.0, 10.0]), np.array([400.0, 10.0]))
    (pieces,) = fit_polylines([run], [0.1])
    drawn = points_at(pieces.cubics, np.linspace(0, 1, 200)).reshape(-1, 2)
    assert np.abs(drawn[:, 1].max() - 11) < 0.1


def test_polylines_fitted_in_one_call_equal_those_fitted_singly() -> None:
    rng = np.random.default_rng(1)
    corners = np.array([(0, 0), (9, 30), (40, 41), (10, 50), (1, 80), (-9, 50), (-40, 40), (-11, 30)], float)
    ways, along = np.roll(corners, -1, axis=0) - corners, (np.arange(30) + 0.5)[None, :, None] / 30
    star = (corners[:, None] + ways[:, None] * along).reshape(-1, 2)
    runs = [Polyline(ring(9.0, 50, squeeze=0.7), closed=True), Polyline(star, closed=True)]
    for count in (2, 9, 60):
        points = np.cumsum(rng.normal(0, 1, (count, 2)), axis=0)
        runs += [Polyline(points[1:-1], False, points[0], points[-1]), Polyline(points, closed=True)]
    for together, run in zip(fit_polylines(runs, [0.2] * len(runs)), runs, strict=True):
        (alone,) = fit_polylines([run], [0.2])
        assert np.allclose(together.cubics, alone.cubics, atol=1e-9)
        assert (together.lines == alone.lines).all()


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
def test_merging_the_halves_of_a_cubic_restores_it(name: str, t: float) -> None:
    cubic = np.array(CURVES[name], float)
    handles = handles_through(*halves(cubic, t))
    made = np.stack([cubic[0], *handles, cubic[3]])
    s = np.linspace(0, 1, 200)
    apart = np.linalg.norm(points_at(cubic, s)[:, None] - points_at(made, s), axis=2).min(axis=1)
    assert apart.max() < 0.02 * np.linalg.norm(cubic[3])


def test_cubics_merged_in_one_call_equal_those_merged_singly() -> None:
    rng = np.random.default_rng(1)
    first, second = rng.normal(0, 5, (2, 30, 4, 2))
    second[:, 0] = first[:, 3]
    first[::5, 1] = first[::5, 0]
    first[7] = second[7] = 0
    alone = [handles_through(a, b) for a, b in zip(first, second, strict=True)]
    np.testing.assert_allclose(handles_through(first, second), alone, atol=1e-9)


@pytest.mark.parametrize("dark", [True, False])
def test_a_diagonal_line_is_connected(dark: bool) -> None:
    """Of two colours that cross on a diagonal, the one that there is less of goes on."""
    painted = np.full((12, 12), int(not dark), np.int32)
    painted[np.arange(12), np.arange(12)] = dark
    labels, _ = components(painted)
    assert len(np.unique(labels[painted == dark])) == 1
    loops = find_loops(LabelMap.of(labels), LabelMap.of(painted))
    assert sorted(loops.region[~loops.is_hole].tolist()) == [0, 1, 2]


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.3, 0.7, 1.0, 1.4, -3.0])
def test_straight_edges_are_exact(slope: float) -> None:
    low, high = (48.3 + slope * (x - 48) for x in (-200, 296))
    body = ground("#102030") + f'<path d="M-200 {low}L296 {high}V900H-200Z" fill="#f0c090"/>'
    image = levels(draw_exactly(body))
    found = find_partition(find_regions(image))
    assert len(found.paint) == 2
    loops = find_loops(found.labels, found.painted)
    boundary = find_boundary(loops, found)
    points = boundary.points / found.scale
    inner = boundary.is_good & (loops.others != NO_REGION) & (np.abs(points - 48) < 40).all(axis=1)
    x, y = points[inner].T
    off = (y - 48.3 - slope * (x - 48)) / np.hypot(1, slope)
    assert len(off) > 50
    assert np.abs(off).max() < 0.06
    assert np.abs(off).mean() < 0.02


def test_cracks_without_antialiasing_stay() -> None:
    image = levels(
        draw(ground("#fff") + '<rect x="10" y="20" width="30" height="9" fill="#123"/>', hard=True)
    )
    found = find_partition(find_regions(image))
    loops = find_loops(found.labels, found.painted)
    inner = (loops.others != NO_REGION) & (loops.vertices > 0).all(axis=1)
    inner &= (loops.vertices < 96 * found.scale).all(axis=1)
    x, y = (find_boundary(loops, found).points / found.scale)[inner].T
    off = np.minimum(np.abs(x[:, None] - [10, 40]).min(axis=1), np.abs(y[:, None] - [20, 29]).min(axis=1))
    assert inner.any() and not off.any()
