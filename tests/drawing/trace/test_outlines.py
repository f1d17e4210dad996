"""The planar map and its sub-pixel places."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.trace.drawings import draw, draw_exactly, ground, levels
from warpsplat.drawing.trace.grids import NO_REGION, components
from warpsplat.drawing.trace.order import find_tree
from warpsplat.drawing.trace.outlines import find_boundary
from warpsplat.drawing.trace.partition import find_partition
from warpsplat.drawing.trace.planar import STEPS, find_loops
from warpsplat.drawing.trace.regions import find_regions


def grey(labels: np.ndarray) -> np.ndarray:
    return np.repeat(labels[..., None] * np.float32(60), 4, axis=2)


def test_loops_go_round_their_regions() -> None:
    labels = np.zeros((7, 8), np.int32)
    labels[1:6, 1:7] = 1
    labels[3, 3:5] = 2
    loops = find_loops(labels, grey(labels))
    found = {
        (int(loops.region[i]), bool(loops.is_hole[i]), int(np.diff(loops.first)[i]))
        for i in range(len(loops))
    }
    assert found == {
        (NO_REGION, True, 30),
        (0, False, 30),
        (0, True, 22),
        (1, False, 22),
        (1, True, 6),
        (2, False, 6),
    }
    tree = find_tree(loops, 3)
    assert tree.parent.tolist() == [NO_REGION, 0, 1]
    assert tree.touches.all()


def test_each_crack_ends_where_the_next_begins() -> None:
    labels, _ = components(
        np.random.default_rng(0).integers(0, 3, (20, 20)).astype(np.int32), np.zeros((20, 20, 4))
    )
    loops = find_loops(labels, np.zeros((20, 20, 4), np.float32))
    for i in range(len(loops)):
        part = slice(loops.first[i], loops.first[i + 1])
        ends = loops.vertices[part] + STEPS[loops.directions[part]]
        assert (ends == np.roll(loops.vertices[part], -1, axis=0)).all()
    outer = loops.region[~loops.is_hole]
    assert sorted(outer.tolist()) == list(range(labels.max() + 1)), "each region has one loop around it"


@pytest.mark.parametrize("dark", [True, False])
def test_a_diagonal_line_is_connected(dark: bool) -> None:
    """Of two colours that cross on a diagonal, the one that there is less of goes on."""
    painted = np.zeros((12, 12), np.int32)
    painted[np.arange(12), np.arange(12)] = 1
    image = np.repeat(np.where((painted == 1) == dark, 0, 200)[..., None], 4, axis=2).astype(np.float32)
    labels, _ = components(painted, image)
    assert len(np.unique(labels[painted == 1])) == 1
    loops = find_loops(labels, image)
    assert sorted(loops.region[~loops.is_hole].tolist()) == [0, 1, 2]


SLOPES = [0.0, 0.1, -0.3, 0.7, 1.0, 1.4, -3.0]


@pytest.mark.parametrize("slope", SLOPES)
def test_straight_edges_are_exact(slope: float) -> None:
    low, high = (48.3 + slope * (x - 48) for x in (-200, 296))
    body = ground("#102030") + f'<path d="M-200 {low}L296 {high}V900H-200Z" fill="#f0c090"/>'
    image = levels(draw_exactly(body))
    found = find_partition(find_regions(image))
    assert len(found.paint) == 2
    loops = find_loops(found.labels, found.fills)
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
    loops = find_loops(found.labels, found.fills)
    inner = (loops.others != NO_REGION) & (loops.vertices > 0).all(axis=1)
    inner &= (loops.vertices < 96 * found.scale).all(axis=1)
    x, y = (find_boundary(loops, found).points / found.scale)[inner].T
    off = np.minimum(np.abs(x[:, None] - [10, 40]).min(axis=1), np.abs(y[:, None] - [20, 29]).min(axis=1))
    assert inner.any() and not off.any()
