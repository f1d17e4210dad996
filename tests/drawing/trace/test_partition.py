"""Regions on a grid finer than the pixels: thin lines, small letters, tips, hard edges, noise."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.trace.drawings import decibels, draw_exactly, ground, levels
from warpsplat.drawing.trace.grids import components
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.partition import Partition, find_partition
from warpsplat.drawing.trace.regions import Regions, find_regions
from warpsplat.drawing.trace.trace import trace
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray

LETTERS = (
    '<g fill="none" stroke="#113366" stroke-width="1.1">'
    '<circle cx="6.3" cy="9.2" r="2.4"/><circle cx="14.6" cy="9.4" r="2.2"/>'
    '<path d="M20.4 6.5v5.2M24.7 6.5v5.2M29.3 3.2v8.5"/></g>'
    '<circle cx="20.4" cy="4.1" r="0.8" fill="#113366"/><circle cx="24.7" cy="4.1" r="0.8" fill="#113366"/>'
)
"""Two letters "o", two "i" and an "l", 12 px high."""


@pytest.fixture(scope="module")
def letters() -> FloatArray:
    return draw_exactly(ground("#ffffff", 36, 16) + LETTERS, 36, 16)


@pytest.fixture(scope="module")
def small(letters: FloatArray) -> Partition:
    return find_partition(find_regions(levels(letters)))


def test_sub_pixels_have_the_area_of_their_pixel(letters: FloatArray, small: Partition) -> None:
    scale = small.scale
    assert scale == 4
    shown = small.fills.reshape(16, scale, 36, scale, 4).mean(axis=(1, 3))
    off = np.abs(shown - levels(letters)).max(axis=2)
    assert off.max() <= 255 * 2 / scale**2 and off.mean() <= 255 * 0.01


def test_letters_have_one_ink_their_counters_and_their_dots(small: Partition) -> None:
    assert len(np.unique(small.paint)) == 2
    # The paper, two counters; two rings, two stems with a dot each, and the "l".
    assert len(small.paint) == 1 + 2 + 2 + 4 + 1


def test_a_trace_of_small_letters_is_near_their_source_at_four_times_the_size(letters: FloatArray) -> None:
    large = draw_exactly(f'<g transform="scale(4)">{ground("#ffffff", 36, 16)}{LETTERS}</g>', 144, 64)
    shown = render(trace(letters).scene, scale=4)
    assert decibels(shown, large) > 23


def test_tips_are_no_parts_of_their_own() -> None:
    points = (180, 40), (196, 84), (240, 88), (206, 116), (218, 160), (180, 136), (142, 160), (154, 116)
    star = "".join(f"L{x / 4.1:.2f} {y / 4.1:.2f}" for x, y in points).replace("L", "M", 1)
    image = draw_exactly(ground("#ffffff", 64, 44) + f'<path d="{star}z" fill="#143cb4"/>', 64, 44)
    found = find_partition(find_regions(levels(image)))
    assert found.scale > 1
    assert len(found.paint) == 2


def test_letters_beside_a_gradient_are_mapped_too() -> None:
    shade = (
        '<linearGradient id="g"><stop stop-color="#c05010"/><stop offset="1" stop-color="#f0b040"/>'
        "</linearGradient>"
        '<rect y="20" width="36" height="20" fill="url(#g)"/>'
    )
    image = draw_exactly(ground("#ffffff", 36, 40) + shade + LETTERS, 36, 40)
    mapped = find_partition(find_regions(levels(image)))
    assert mapped.scale == 4
    shown = mapped.fills.reshape(40, 4, 36, 4, 4).mean(axis=(1, 3))
    assert np.abs(shown - levels(image)).max(axis=2).mean() <= 255 * 0.01
    assert sum(mapped.colorings[k].ramp is not None for k in np.unique(mapped.paint)) == 1


@pytest.mark.parametrize("seed", range(24))
def test_regions_of_random_maps_keep_the_areas_of_each_pixel(seed: int) -> None:
    """Without antialiasing a share is off by a half at the most."""
    rng = np.random.default_rng(seed)
    height, width = rng.integers(8, 41, 2)
    painted = rng.integers(0, 2 + seed % 3, (height, width)).astype(np.int32)
    palette = np.array(
        [[255, 255, 255, 255], [200, 30, 20, 255], [20, 30, 120, 255], [0, 0, 0, 255]], np.float32
    )
    image = palette[painted]
    labels, paint = components(painted, image)
    regions = Regions(image, labels, image, paint, [Coloring(color) for color in palette], 0.0)
    found = find_partition(regions)
    shown = found.paint[found.labels].reshape(height, found.scale, width, found.scale)
    own = (shown == painted[:, None, :, None]).mean(axis=(1, 3))
    assert own.min() > 0.4 and own.mean() > 0.6


def test_lines_of_a_third_of_a_pixel_are_whole() -> None:
    """An ink drawing, smaller than its lines are wide."""
    curves = "".join(f'<path d="M{4 + 8 * i} 60Q{20 - 6 * i} 30 {8 * i + 2} 4"/>' for i in range(8))
    image = draw_exactly(
        ground("#ffffff", 64, 64) + f'<g fill="none" stroke="#000" stroke-width=".7">{curves}</g>', 64, 64
    )
    shown = render(trace(image).scene)
    assert decibels(shown, image) > 24


def test_outlines_go_straight_on_at_the_border_of_the_image() -> None:
    image = draw_exactly(ground("#ffffff", 48, 48) + '<circle cx="24" cy="24" r="24" fill="#000"/>', 48, 48)
    shown = render(trace(image).scene)
    assert decibels(shown, image) > 39.5
