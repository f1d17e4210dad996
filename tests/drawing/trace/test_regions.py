"""Regions: one for each part of a drawing, with its own colour, whatever antialiasing and JPEG do."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.trace.drawings import draw, ground, levels, star
from warpsplat.drawing.trace.fewer import fewer_regions
from warpsplat.drawing.trace.regions import Regions, find_regions


def colors_of(found: Regions) -> set[tuple[int, ...]]:
    """Colours of the regions, with their opacity."""
    return {tuple(np.round(found.colorings[p].color).astype(int).tolist()) for p in found.paint.tolist()}


def test_an_edge_pixel_belongs_to_what_has_most_of_it() -> None:
    found = find_regions(levels(draw(ground("#fff") + '<rect x="20.3" y="20.7" width="40" height="40"/>')))
    inside = found.labels == found.labels[40, 40]
    rows, columns = np.nonzero(inside)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (21, 60, 20, 59)
    assert inside.sum() == 1600


@pytest.mark.parametrize("width", [0.8, 1.0, 1.5])
def test_thin_lines_are_regions(width: float) -> None:
    body = ground("#fff") + f'<path d="M8 12L88 40" stroke="#000" stroke-width="{width}"/>'
    body += '<rect x="30" y="60" width="20" height="20"/>'
    found = find_regions(levels(draw(body)))
    assert colors_of(found) == {(255, 255, 255, 255), (0, 0, 0, 255)}, "the square tells the line's colour"
    line = found.labels[26, 48]
    assert found.colorings[found.paint[line]].color[0] == 0
    assert np.ptp(np.nonzero(found.labels == line)[1]) > 74, "in one piece"


def test_a_dot_of_its_grounds_colour_is_no_mixture() -> None:
    """Beyond the ring around it there is its colour as well."""
    body = '<circle cx="32" cy="32" r="24" fill="#ff0" stroke="#000" stroke-width="1.5"/>'
    body += '<circle cx="32" cy="32" r="4" fill="#ff0" stroke="#000"/>'
    found = find_regions(levels(draw(body, 64, 64)))
    shown = found.paint[found.labels]
    assert shown[32, 32] == shown[20, 32] != shown[28, 32], "dot, ground, ring"


def test_thin_bars_and_their_outlines_are_two_colours() -> None:
    """All outlines are one thin part, and so is what is thin between them."""
    bars = '<path d="M14 14L40 60M24 10L60 20" stroke'
    body = f'{bars}="#000" stroke-width="5"/>{bars}="#ff0" stroke-width="3"/>'
    body += '<rect x="4" y="4" width="20" height="20" fill="#ff0" stroke="#000" stroke-width="2"/>'
    body += '<rect x="6" y="50" width="10" height="10"/>'
    image = levels(draw(body, 64, 64))
    found = find_regions(image)
    assert colors_of(found) == {(0, 0, 0, 0), (255, 255, 0, 255), (0, 0, 0, 255)}
    bright = (image[..., :2].min(axis=2) > 240) & (np.arange(64)[:, None] > 26)
    assert bright.sum() > 8
    assert all(found.colorings[p].color[0] == 255 for p in found.paint[found.labels[bright]])


@pytest.mark.parametrize("quality", [60, 85])
def test_what_jpeg_leaves_is_no_region(quality: int) -> None:
    body = ground("#264653") + '<rect x="16" y="14" width="30" height="60" fill="#e9c46a"/>'
    body += '<circle cx="68" cy="50" r="18" fill="#e76f51"/>'
    found = find_regions(levels(draw(body, jpeg=quality)))
    shown = sorted(colors_of(found))
    assert len(shown) == len(found.paint) == 3
    wanted = [(0x26, 0x46, 0x53), (0xE7, 0x6F, 0x51), (0xE9, 0xC4, 0x6A)]
    assert np.abs(np.array(shown)[:, :3] - wanted).max() <= 6


@pytest.mark.parametrize("quality", [50, 60, 75, 85])
@pytest.mark.parametrize(("tips", "inner"), [(6, 19), (5, 14)])
def test_tips_that_jpeg_tints_are_no_regions(quality: int, tips: int, inner: float) -> None:
    body = ground("#ffffff") + f'<polygon points="{star(48, 48, 45, inner, tips)}" fill="#c1121f"/>'
    found = find_regions(levels(draw(body, jpeg=quality)))
    assert len(found.paint) == 2


def test_regions_seen_least_go_first() -> None:
    body = ground("#fff") + '<rect x="8" y="8" width="50" height="50" fill="#c00"/>'
    body += '<rect x="70" y="70" width="12" height="12" fill="#0a0"/><rect x="20" y="20" width="20" '
    found = find_regions(levels(draw(body + 'height="20" fill="#c20808"/>')))
    assert len(found.paint) == 4
    three, two = fewer_regions(found, 3), fewer_regions(found, 2)
    assert colors_of(three) == {(255, 255, 255, 255), (0xCC, 0, 0, 255), (0, 0xAA, 0, 255)}
    assert three.labels[30, 30] == three.labels[12, 12]
    assert colors_of(two) == {(255, 255, 255, 255), (0xCC, 0, 0, 255)}
    assert fewer_regions(found, 4) is found


def test_paper_between_dense_lines_is_paper() -> None:
    """No pixel there is free of ink, and the nearest paper is farther than mixtures are looked for."""
    lines = "".join(f'<path d="M{20 + 2 * i} 20v56h.9v-56z"/>' for i in range(28))
    image = levels(draw(ground("#fff") + lines, 96, 96))
    found = find_regions(image)
    inner = found.fills[30:66, 30:66, 0]
    paper = image[30:66, 30:66, 0] > 160
    assert paper.any()
    assert (inner[paper] > 200).mean() > 0.9
