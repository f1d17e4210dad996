"""Label maps with cells at borders alone, against plain arrays of cells."""

import numpy as np
import pytest

from warpsplat.drawing.trace.grids import NO_REGION, Ints, components
from warpsplat.drawing.trace.label_map import LabelMap, label_components
from warpsplat.drawing.trace.planar import find_loops


def both(seed: int) -> tuple[LabelMap, Ints]:
    """Return a random map, and its cells."""
    rng = np.random.default_rng(seed)
    height, width = rng.integers(2, 12, 2).tolist()
    scale = 1 + seed % 4
    pixels = np.repeat(rng.integers(0, 3, (height, -(-width // 3))), 3, axis=1)[:, :width].astype(np.int32)
    rows, columns = np.nonzero(rng.random(pixels.shape) < 0.3)
    cut = rng.integers(0, 3, (len(rows), scale, scale)).astype(np.int32)
    cells = np.repeat(np.repeat(pixels, scale, axis=0), scale, axis=1)
    cells.reshape(height, scale, width, scale)[rows, :, columns] = cut
    return LabelMap.cut(pixels, rows, columns, cut), cells


@pytest.mark.parametrize("seed", range(24))
def test_a_map_has_the_labels_of_its_cells(seed: int) -> None:
    labels, cells = both(seed)
    height, width = labels.shape
    assert labels.shape == cells.shape
    np.testing.assert_array_equal(labels.window(0, 0, height, width), cells)
    np.testing.assert_array_equal(labels.window(1, 1, height - 1, width), cells[1:-1, 1:])
    framed = np.pad(cells, 1, constant_values=NO_REGION)
    np.testing.assert_array_equal(labels.at(*np.ogrid[-1 : height + 1, -1 : width + 1]), framed)
    np.testing.assert_array_equal(labels.sizes(3), np.bincount(cells.reshape(-1), minlength=3))
    np.testing.assert_array_equal(
        labels.border(), np.concatenate([cells[0], cells[-1], cells[:, 0], cells[:, -1]])
    )
    doubled = labels.mapped(np.array([0, 2, 4]), 9)
    np.testing.assert_array_equal(doubled.window(0, 0, height, width), 2 * cells)
    assert doubled.at(np.array(-1), np.array(0)) == 9
    above, before = labels.sides()
    found = framed[1:, 1:-1] != framed[:-1, 1:-1], framed[1:-1, 1:] != framed[1:-1, :-1]
    for (rows, columns, _, own), differ in zip((above, before), found, strict=True):
        assert len(rows) == differ.sum() and differ[rows, columns].all()
        np.testing.assert_array_equal(own, framed[rows + 1, columns + 1])
    np.testing.assert_array_equal(above[2], framed[above[0], above[1] + 1])
    np.testing.assert_array_equal(before[2], framed[before[0] + 1, before[1]])


@pytest.mark.parametrize("seed", range(24))
def test_components_are_those_of_the_cells(seed: int) -> None:
    values, cells = both(seed)
    labels, value = label_components(values)
    wanted, _ = components(cells)
    found = labels.window(0, 0, *labels.shape)
    np.testing.assert_array_equal(value[found], cells)
    pairs = np.unique(np.stack([found, wanted], axis=-1).reshape(-1, 2), axis=0)
    assert len(pairs) == len(value) == wanted.max() + 1
    assert (labels.pixels[[0, -1]] == NO_REGION).all()


@pytest.mark.parametrize("seed", range(24))
def test_loops_bound_each_region_once(seed: int) -> None:
    values, cells = both(seed)
    labels, value = label_components(values)
    loops = find_loops(labels, values)
    assert sorted(loops.region[~loops.is_hole].tolist()) == list(range(len(value)))
    height, width = cells.shape
    assert len(loops.vertices) == 2 * sum(len(side[0]) for side in labels.sides())
    assert (loops.vertices >= 0).all() and (loops.vertices <= [width, height]).all()
