"""Colours of a partition that explain the pixels of its image."""

from __future__ import annotations

import numpy as np

from tests.drawing.trace.drawings import as_file, decibels, draw_exactly, ground
from warpsplat.drawing.trace.assign import fill_gaps
from warpsplat.drawing.trace.colors import with_best_colors
from warpsplat.drawing.trace.grids import NO_REGION
from warpsplat.drawing.trace.palette import Coloring, Parts
from warpsplat.drawing.trace.partition import find_partition
from warpsplat.drawing.trace.regions import Regions
from warpsplat.drawing.trace.trace import trace
from warpsplat.rendering.renderer import render

WHITE = np.full(4, 255, np.float32)


def grey(value: float) -> np.ndarray:
    return np.array([value, value, value, 255], np.float32)


def stroke(ink: float, shown: float) -> Regions:
    """A bar of 24x5 px that is taken for one of a darker ink than its pixels show."""
    labels = np.zeros((16, 32), np.int32)
    labels[5:10, 4:28] = 1
    colorings = [Coloring(WHITE), Coloring(grey(ink))]
    fills = np.array([coloring.color for coloring in colorings])[labels]
    image = np.where(labels[..., None] == 1, grey(shown), WHITE).astype(np.float32)
    return Regions(image, labels, fills, np.arange(2, dtype=np.int32), colorings, 0.0)


def colors_of(regions: Regions) -> list[float]:
    partition = with_best_colors(find_partition(regions), regions)
    return [float(coloring.color[0]) for coloring in partition.colorings]


def test_ink_has_the_colour_of_its_pixels() -> None:
    paper, ink = colors_of(stroke(0, 60))
    assert paper == 255
    assert abs(ink - 60) < 4
    assert colors_of(stroke(60, 60)) == colors_of(stroke(60, 61)) == [255, 60], "up to rounding"


def test_the_main_colour_is_that_of_most_area_in_all_its_parts() -> None:
    """White in three parts, together larger than the one of ink, and a white pixel that is not labelled."""
    labels = np.zeros((9, 22), np.int32)
    labels[:, 10:] = np.repeat([1, 2, 3], 4)
    colorings = [Coloring(grey(0)), Coloring(WHITE)]
    paint = np.array([0, 1, 1, 1], np.int32)
    labels[4, 4] = NO_REGION
    fills = np.array([coloring.color for coloring in colorings])[paint[labels]]
    image = fills.copy()
    image[4, 4] = WHITE
    painted, _ = fill_gaps(image, Parts(labels, fills, paint, colorings))
    assert painted[4, 4] == 1


def test_lines_keep_their_ink_where_webp_leaves_tints_around_them() -> None:
    """No region lies near most of these: they tell nothing of the ink."""
    arcs = ""
    for i in range(14):
        radius, ends = 18 + 8 * i, np.radians([20 * i, 20 * i + 250])
        (a, b), (c, d) = (128 + radius * np.stack([np.cos(ends), np.sin(ends)], axis=1)).tolist()
        arcs += f'<path d="M{a} {b}A{radius} {radius} 0 1 1 {c} {d}"/>'
    body = f'{ground("#ffffff", 256, 256)}<g fill="none" stroke="#1d3557" stroke-width="1.5">{arcs}</g>'
    image = draw_exactly(body, 256, 256)
    assert decibels(render(trace(as_file(image, "webp", quality=80)).scene), image) > 20
