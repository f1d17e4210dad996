"""Regions: one for each part of a drawing, with its own colour, whatever antialiasing and JPEG do."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from tests.drawing.trace.drawings import as_file, decibels, draw, draw_exactly, ground, levels, star
from warpsplat.drawing.trace.fewer import _merge, fewer_regions
from warpsplat.drawing.trace.grids import NO_REGION, components, nearest_in, nearest_of
from warpsplat.drawing.trace.palette import Coloring, Parts
from warpsplat.drawing.trace.partition import find_partition
from warpsplat.drawing.trace.regions import Regions, find_regions
from warpsplat.drawing.trace.thin_parts import _with_distant_pixels
from warpsplat.drawing.trace.trace import trace
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray


def colors_of(found: Regions) -> set[tuple[int, ...]]:
    """Colours of the regions, with their opacity."""
    return {tuple(np.round(found.colorings[p].color).astype(int).tolist()) for p in found.paint.tolist()}


def test_the_nearest_pixel_of_a_mask() -> None:
    mask = np.random.default_rng(2).random((30, 40)) < 0.02
    mask[:6] = mask[:, :9] = False
    rows, columns = np.array([2, 20, 29, 11]), np.array([39, 1, 30, 11])
    np.testing.assert_array_equal(nearest_of(mask, rows, columns), nearest_in(mask)[rows, columns])
    assert not len(nearest_of(mask, rows[:0], columns[:0]))


def test_an_edge_pixel_belongs_to_the_region_with_most_coverage() -> None:
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
def test_jpeg_artefacts_make_no_regions(quality: int) -> None:
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
    assert (fewer_regions(found, 4).labels == found.labels).all()


def test_merged_regions_are_judged_by_their_own_pixels() -> None:
    """Or shading would be merged step by step, each of which costs little."""
    colors = np.array([[0, 0, 0, 255], [10, 0, 0, 255], [20, 0, 0, 255]])
    merged = [
        _merge([{1}, {0, 2}, {1}], [10, 10, 99], colors, most=3, dearest=dearest).tolist()
        for dearest in (999, 3999, 4000)
    ]
    assert merged == [[0, 1, 2], [1, 1, 2], [2, 2, 2]]


def test_paper_between_dense_lines_is_paper() -> None:
    """No pixel there is free of ink, and the nearest paper is farther than mixtures are looked for."""
    lines = "".join(f'<path d="M{20 + 2 * i} 20v56h.9v-56z"/>' for i in range(28))
    image = levels(draw(ground("#fff") + lines, 96, 96))
    found = find_regions(image)
    inner = found.fills[30:66, 30:66, 0]
    paper = image[30:66, 30:66, 0] > 160
    assert paper.any()
    assert (inner[paper] > 200).mean() > 0.9


LETTERS = (
    '<g fill="none" stroke="#113366" stroke-width="1.1">'
    '<circle cx="6.3" cy="9.2" r="2.4"/><circle cx="14.6" cy="9.4" r="2.2"/>'
    '<path d="M20.4 6.5v5.2M24.7 6.5v5.2M29.3 3.2v8.5"/></g>'
    '<circle cx="20.4" cy="4.1" r="0.8" fill="#113366"/><circle cx="24.7" cy="4.1" r="0.8" fill="#113366"/>'
)
"""Two letters "o", two "i" and an "l", 12 px high."""


def thin(paths: str, color: str, width: float) -> str:
    return f'<g fill="none" stroke="{color}" stroke-width="{width}">{paths}</g>'


def arcs() -> Iterator[str]:
    for i in range(14):
        radius, ends = 18 + 8 * i, np.radians([20 * i, 20 * i + 250])
        (a, b), (c, d) = (128 + radius * np.stack([np.cos(ends), np.sin(ends)], axis=1)).tolist()
        yield f'<path d="M{a} {b}A{radius} {radius} 0 1 1 {c} {d}"/>'


CURVES = "".join(f'<path d="M{4 + 8 * i} 60Q{20 - 6 * i} 30 {8 * i + 2} 4"/>' for i in range(8))


@pytest.mark.parametrize(
    ("body", "width", "height", "scale", "least"),
    [
        (LETTERS, 36, 16, 4, 23),
        (thin(CURVES, "#000", 0.7), 64, 64, 1, 24),
        ('<circle cx="24" cy="24" r="24"/>', 48, 48, 1, 39.5),
        (thin("".join(arcs()), "#1d3557", 1.5), 256, 256, 1, 20),
    ],
    ids=["small letters", "lines of a third of a pixel", "straight on at the border", "tints of WebP"],
)
def test_fine_drawings_are_near_their_source(
    body: str, width: int, height: int, scale: int, least: float
) -> None:
    """No region lies near most of the tints that WebP leaves around lines: they tell nothing of the ink."""
    body = ground("#ffffff", width, height) + body
    large = draw_exactly(f'<g transform="scale({scale})">{body}</g>', scale * width, scale * height)
    image = draw_exactly(body, width, height)
    image = as_file(image, "webp", quality=80) if width == 256 else image
    assert decibels(render(trace(image).scene, scale=scale), large) > least


def test_the_ground_between_lines_of_a_mesh_stays() -> None:
    """JPEG leaves nothing flat between them, and most of the image has another colour."""
    lines = "".join(f'<path d="M{x} 30l48 66M{x + 48} 30l-48 66" stroke="#111"/>' for x in range(-64, 160, 9))
    image = draw_exactly(ground("#fff") + '<path d="M0 26h96v70H0z" fill="#d8d2b0"/>' + lines)
    _, code = cv2.imencode(
        ".jpg", np.round(255 * image[..., ::-1]).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 95]
    )
    decoded = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR))
    image = levels(decoded[..., ::-1].astype(np.float32) / 255)
    found = find_regions(image)
    colors = np.array([coloring.color for coloring in found.colorings])[found.paint[found.labels]]
    paper = [216, 210, 176, 255]
    is_paper, shown = (np.abs(each - paper).max(axis=2) <= 8 for each in (image, colors))
    assert shown[is_paper].mean() > 0.9


def test_far_ground_is_where_squares_of_pixels_show_it() -> None:
    """A line of pixels that has its colour is a mixture of others by chance."""
    image = np.full((24, 40, 3), 90, np.float32)
    image[:, :4] = image[10:12, 20:22] = image[4, 16:30] = 200
    labels = np.full((24, 40), NO_REGION, np.int32)
    labels[:, :4] = 0
    parts = Parts(labels, image.copy(), np.zeros(1, np.int32), [Coloring(image[0, 0])])
    found = _with_distant_pixels(image, parts, 8.0).labels != labels
    assert found[10:12, 20:22].all() and found.sum() == 4


def test_a_strip_along_the_border_is_as_wide_as_its_pixels_show() -> None:
    """Nothing of its colour is near, but the image is mostly of it."""
    image = levels(draw_exactly(ground("#ffffff") + '<path d="M20 70h40v25.7H20z" fill="#102030"/>'))
    found = find_partition(find_regions(image))
    cells = found.painted.window(0, 0, *found.labels.shape)
    middle = cells[:, 40 * found.scale]
    assert middle[-1] == cells[0, 0] != middle[-2]


def test_thin_lines_are_as_fine_in_a_large_image() -> None:
    """Cells are at borders alone, so that the rest of an image has no part in how many lie along a pixel."""
    image = levels(draw_exactly(ground("#ffffff") + '<path d="M9 80 80 9" stroke="#123" stroke-width=".8"/>'))
    large = np.full((1100, 1100, 4), 255, np.float32)
    large[:96, :96] = image
    small, found = (find_partition(find_regions(each)) for each in (image, large))
    np.testing.assert_array_equal(
        found.painted.window(0, 0, *small.labels.shape), small.painted.window(0, 0, *small.labels.shape)
    )


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
    labels, paint = components(painted)
    regions = Regions(image, labels, image, paint, [Coloring(color) for color in palette], 0.0)
    found = find_partition(regions)
    shown = found.painted.window(0, 0, *found.labels.shape).reshape(height, found.scale, width, found.scale)
    own = (shown == painted[:, None, :, None]).mean(axis=(1, 3))
    assert own.min() > 0.4 and own.mean() > 0.6


BROWN, BLUE = (120, 80, 40), (60, 110, 160)


def drawn(*lines: tuple[str, tuple[int, int, int]]) -> FloatArray:
    """Return lines of a pixel in width on a pale ground."""
    paths = "".join(
        f'<path d="{data}" fill="none" stroke="rgb{color}" stroke-width="1"/>' for data, color in lines
    )
    return draw_exactly(ground("#ffffd0", 64, 64) + paths, 64, 64)


def inks_of(image: FloatArray) -> FloatArray:
    """Return the colours of an image's pixels if they were covered."""
    return find_regions(levels(image)).fills


def test_lines_that_touch_keep_their_colours() -> None:
    fills = inks_of(drawn(("M4 60Q20 20 32 32", BROWN), ("M32 32Q50 50 60 10", BLUE)))
    thin = np.abs(fills - fills[0, 0]).max(axis=2) > 9
    assert thin[:, :28].any() and thin[:, 36:].any()
    for part, own, other in ((np.s_[:, :28], BROWN, BLUE), (np.s_[:, 36:], BLUE, BROWN)):
        shown = fills[part][thin[part]][:, :3]
        nearer = np.abs(shown - own).sum(axis=1) < np.abs(shown - other).sum(axis=1)
        assert nearer.mean() > 0.95


@pytest.mark.parametrize("color", [BROWN, BLUE])
def test_lines_of_one_colour_have_one_ink(color: tuple[int, int, int]) -> None:
    fills = inks_of(drawn(("M4 60Q20 20 32 32", color), ("M10.3 10.2L50.1 14.8", color)))
    _, *inks = sorted(np.unique(fills.reshape(-1, 4), axis=0).tolist(), reverse=True)
    assert len(inks) == 1
    assert np.abs(np.array(inks[0][:3]) - color).max() < 32


def test_a_faint_line_across_several_colours_has_its_ink() -> None:
    """No pixel is of the ink alone: on each bar it is the one that all its mixtures point to."""
    bars = "".join(
        f'<rect x="{x}" width="16" height="64" fill="{color}"/>'
        for x, color in ((8, "#264653"), (32, "#2a9d8f"), (56, "#e76f51"))
    )
    body = ground("#fff", 80, 64) + bars + '<rect y="31.75" width="80" height=".75" fill="#ccc"/>'
    fills = find_regions(levels(draw_exactly(body, 80, 64))).fills
    on_line = np.abs(fills[32] - [204, 204, 204, 255]).max(axis=1) < 16
    assert on_line[[2, 3, 14, 15, 16, 38, 39, 40, 63, 64, 65, 76, 77]].all()


def test_specks_on_gradients_alone_have_no_ink() -> None:
    """There is no flat colour at all, and a speck is worth none."""
    x = np.linspace(0, 1, 96, dtype=np.float32)[None, :, None]
    image = np.repeat((1 - x) * [0.9, 0.2, 0.1] + x * [0.1, 0.3, 0.8], 96, axis=0).astype(np.float32)
    plain = find_regions(levels(image))
    image[40, 40] += 0.12
    found = find_regions(levels(image))
    assert all(coloring.ramp is not None for coloring in plain.colorings)
    assert len(found.paint) == len(plain.paint)


@pytest.mark.parametrize("seed", [0, 3, 8])
@pytest.mark.parametrize("is_negative", [False, True], ids=["as it is", "negative"])
def test_a_grid_on_a_chart_has_its_ink(seed: int, is_negative: bool) -> None:
    """Where lines cross one another, other inks explain a little more, but are less exact elsewhere."""
    quarters = functools.partial(np.random.default_rng(seed).integers, 0, 4)
    rows = np.random.default_rng(seed).integers(5, 60, 4).tolist()
    bars = "".join(
        f'<rect x="{10 + 20 * i + quarters() / 4}" y="{row}" width="{12 + quarters() / 4}" height="90"'
        f' fill="{color}"/>'
        for i, (row, color) in enumerate(zip(rows, ("#264653", "#2a9d8f", "#e9c46a", "#e76f51"), strict=True))
    )
    grid = "".join(
        f'<rect y="{row + quarters() / 4}" width="96" height=".75" fill="#ccc"/>' for row in (10, 30, 50)
    )
    axes = '<rect x="4" y="3" width="1.5" height="64"/><rect y="66" width="96" height="1.5"/>'
    ticks = '<path d="M1 8l3 4M1 28l3 -3M1 48l2 5" stroke="#000"/>'
    image = levels(draw_exactly(ground("#fff", 96, 72) + bars + grid + axes + ticks, 96, 72))
    ink = 204
    if is_negative:
        image[..., :3], ink = 255 - image[..., :3], 51
    inks = np.array([coloring.color for coloring in find_regions(image).colorings])
    assert np.abs(inks - [ink, ink, ink, 255]).max(axis=1).min() < 3
