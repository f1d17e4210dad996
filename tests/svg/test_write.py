"""Files: numbers, paths, reading them back, and how independent viewers show them."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import cairosvg
import cv2
import numpy as np
import pytest
from PIL import Image

from tests.drawing.drawings import logo
from tests.scenes import CURVES, disc, mixed_scene, random_scene, with_gradients
from tests.svg.foreign import load_scene
from warpsplat.files.output import may_replace
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Canvas, Kind, Scene
from warpsplat.svg.data import integers, path_data
from warpsplat.svg.inspect import NAMESPACE
from warpsplat.svg.numbers import data_uri, hex_colors, number
from warpsplat.svg.paths import cubics
from warpsplat.svg.viewer import on_white, render_own, render_svg
from warpsplat.svg.write import (
    GRIDS,
    SHORT,
    minified,
    resized,
    rounded,
    shortened,
    width_decimals,
    write_svg,
)


def test_numbers_and_colours() -> None:
    texts = [number(value, 1) for value in (0.0, -0.04, 0.5, -0.5, 10.0, -20.26)]
    assert texts == ["0", "0", ".5", "-.5", "10", "-20.3"]
    assert (number(100.0, 0), number(1.005, 3)) == ("100", "1.005")
    assert integers([(1, -2), (-13, 0), (7, 8)]) == "1-2-13 0 7 8", "a sign separates"
    colors = np.array([[1, 1, 1], [0, 0.5, 1.2], [0.2, 0.4, -1], [0.2, 0.4, 0.01]], np.float32)
    assert hex_colors(colors) == ["#fff", "#0080ff", "#360", "#336603"]


@pytest.mark.parametrize("basis", CURVES)
def test_rounding_does_not_add_up(basis: Basis) -> None:
    """A thousand steps of 0.4 units: the end is at 400, not at 0."""
    points = np.stack([0.4 * np.arange(1000), np.zeros(1000)], axis=1).astype(np.float32)
    points[:, 1] = np.arange(1000) % 3  # no lines
    (data,) = path_data(Scene.uniform(Kind.STROKE, Canvas(400, 1, None), points[None], basis), 1)
    (drawn,) = cubics(data, keep_dots=True)
    assert ("l" not in data and "c" in data) if basis == Basis.CUBIC else "t" in data
    assert drawn.points[-1, 0] == pytest.approx(400, abs=1)


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("per_pixel", GRIDS)
def test_numbers_of_a_file_are_short(kind: Kind, per_pixel: float) -> None:
    """Coordinates are whole, opacities have two decimals and widths one; fills are closed."""
    scene = mixed_scene(41, 37)
    text = write_svg(scene.take(np.flatnonzero(scene.kind == kind)), per_pixel=per_pixel)
    paths = re.findall(r' d="([^"]*)"', text)
    assert len(paths) == (scene.kind == kind).sum()
    for data in paths:
        assert re.fullmatch(r"[Mm]-?\d+(?:[ -]\d+)+(?:[cqstlhvCQSTLHV]-?\d+(?:[ -]\d+)*)*z?", data), data
        assert data.endswith("z") == (kind == Kind.FILL)
        assert "  " not in data and " -" not in data
    assert all(len(x) <= 3 for x in re.findall(r'-opacity="([^"]*)"', text))
    assert all(re.fullmatch(r"\d*(\.\d)?", x) for x in re.findall(r'stroke-width="([^"]*)"', text))
    root = ElementTree.fromstring(text)
    assert (root.attrib["width"], root.attrib["height"]) == ("41", "37")
    assert [float(x) for x in root.attrib["viewBox"].split()] == [0, 0, 41 * per_pixel, 37 * per_pixel]


def without_sharing(text: str) -> str:
    """Return the file with each opacity and colour at its path."""
    root = ElementTree.fromstring(text)
    for parent in (root, *root.findall(f"{{{NAMESPACE}}}g")):
        for index, child in reversed(list(enumerate(parent))):
            if child.tag.endswith("}g") and "stroke-linecap" not in child.attrib:
                for path in child:
                    path.attrib.update(child.attrib)
                parent[index : index + 1] = list(child)
    ElementTree.register_namespace("", NAMESPACE)
    head, mark, _ = text.partition("-->")
    body = ElementTree.tostring(root, encoding="unicode").replace(" />", "/>").partition(">")[2]
    return head + mark + body + "\n"


@pytest.mark.parametrize("levels", [1, 2, 3, 10, 100])
def test_groups_are_never_longer_than_none(levels: int) -> None:
    """For any opacities, in any order, of fills and strokes; the picture is the same."""
    rng = np.random.default_rng(0)
    scene = mixed_scene(seed=levels).append(mixed_scene(seed=levels + 1))
    scene = scene.take(np.sort(rng.integers(0, len(scene), 50)))
    values = (rng.integers(1, levels + 1, len(scene)) / levels).astype(np.float32)
    scene = replace(scene, opacities=values)
    text = write_svg(scene, per_pixel=5)
    plain = without_sharing(text)
    assert len(text) < len(plain) if levels in (2, 3) else len(text) <= len(plain)
    np.testing.assert_array_equal(on_white(render_svg(text)), on_white(render_svg(plain)))
    for kind in Kind:
        part = scene.take(np.flatnonzero(scene.kind == kind))
        back, _ = load_scene(write_svg(part, per_pixel=5), 40, 36, "a.svg")
        np.testing.assert_array_equal(back.opacities, rounded(part, 5).opacities)


@pytest.mark.parametrize(("per_pixel", "decimals"), [(0.125, 1), (1, 1), (3, 1), (4, 0), (100, 0)])
def test_decimals_of_widths(per_pixel: float, decimals: int) -> None:
    """In the file and in rounded scenes: a quarter of a pixel, or finer."""
    assert width_decimals(per_pixel) == decimals
    scene = random_scene(Kind.STROKE, count=20)
    text = write_svg(scene, per_pixel=per_pixel)
    written = re.findall(r'stroke-width="([^"]*)"', text)
    assert any("." in width for width in written) == (decimals == 1)
    held = rounded(scene, per_pixel).widths
    np.testing.assert_allclose([float(width) / per_pixel for width in written], held, rtol=1e-6)
    assert np.abs(held - scene.widths).max() <= 0.5 * max(0.25, 0.1 / per_pixel) + 1e-6


@pytest.mark.parametrize("opacity", [0.9949, 0.995, 0.9985, 1.0])
def test_opacities_that_round_to_1_are_left_out(opacity: float) -> None:
    scene = replace(disc(10, 30, 15), opacities=np.full(1, opacity, np.float32))
    text = write_svg(scene)
    assert ("fill-opacity" in text) == (opacity < 0.995)
    assert float(rounded(scene, 100).opacities[0]) == pytest.approx(0.99 if opacity < 0.995 else 1)


def test_shown_at_another_size() -> None:
    """A part of a file at another scale looks as that part of the whole file."""
    text = write_svg(random_scene(Kind.FILL, count=6, width=61, height=83), per_pixel=3)
    big = on_white(render_svg(text, zoom=2))
    shown = on_white(render_own(resized(text, 100, 120, 2.0)))
    assert shown.shape == (120, 100, 3)
    assert psnr(shown, big[:120, :100]) > 45
    small = on_white(render_own(resized(text, 30, 41, 0.5)))
    assert psnr(small, cv2.resize(on_white(render_svg(text)), (30, 41), interpolation=cv2.INTER_AREA)) > 20


@pytest.mark.parametrize("basis", CURVES)
@pytest.mark.parametrize("kind", list(Kind))
def test_the_file_looks_as_the_render(device: str, kind: Kind, basis: Basis) -> None:
    """Painter's order, opacity, extent; in another viewer as well."""
    scene = random_scene(kind, count=10, width=96, height=80, seed=3, basis=basis)
    backend = Backend.on(device)
    mine = render(scene, backend=backend).astype(np.float64) * 255
    text = write_svg(scene)
    shown = on_white(render_svg(text))
    assert psnr(mine, shown) > 42
    other = Image.open(io.BytesIO(cairosvg.svg2png(bytestring=text.encode())))
    assert np.abs(shown - on_white(other)).mean() < 0.01 * 255
    swapped = replace(scene, points=scene.take(np.arange(len(scene))[::-1]).points)
    assert psnr(mine, on_white(render_svg(write_svg(swapped)))) < 25


def test_titles() -> None:
    title = 'A <b> & "c" \x00\x0b\ud800 ä'
    text = write_svg(random_scene(Kind.FILL, count=2), title=title)
    root = ElementTree.fromstring(text)
    assert root[0].tag == f"{{{NAMESPACE}}}title"
    assert root[0].text == 'A <b> & "c"  ä'
    assert "title" not in write_svg(random_scene(Kind.FILL, count=2))
    back, _ = load_scene(text, 40, 36, "a.svg")
    assert len(back) == 2


def test_fills_of_one_paint_that_lie_apart_are_one_path() -> None:
    """The path looks the same and is read as a shape of two contours; overlapping shapes stay two."""
    scene = random_scene(Kind.FILL, count=2, basis=Basis.SPLINE)
    points = scene.points - scene.points.mean(axis=0)
    points *= 6 / np.abs(points).max()
    rows = np.repeat([0, 1], scene.point_counts())
    for gap, count in ((20, 1), (3, 2)):
        places = np.array([[8, 20], [8 + gap, 20]])[rows]
        values = {"colors": scene.colors[[0, 0]], "opacities": np.full(2, 0.6, np.float32)}
        alike = replace(scene, points=(points + places).astype(np.float32), **values)
        text = write_svg(alike, per_pixel=10)
        assert text.count("<path") == count
        shown = np.asarray(render_svg(text), np.int16)
        named = np.asarray(render_svg(write_svg(alike, per_pixel=10, ids=True)), np.int16)
        np.testing.assert_array_equal(shown, named)
        back, _ = load_scene(text, scene.canvas.width, scene.canvas.height, "x.svg")
        assert len(back) == count
        assert (back.basis == Basis.SPLINE).all()


@pytest.mark.parametrize("kind", list(Kind))
def test_short_files_are_marked_by_the_order_of_their_attributes(kind: Kind, tmp_path: Path) -> None:
    """They look the same, are recognised, and are no longer than without a mark."""
    text = write_svg(random_scene(kind, count=3), per_pixel=0.5)
    short, small = shortened(text), minified(text)
    assert shortened(short) == short != text
    assert minified(short) == minified(small) == small
    assert len(short) == len(small) == len(text) - len("<!--warpsplat-->\n\n")
    assert "\n" not in small and "<!--" not in small
    for other in (short, small):
        np.testing.assert_array_equal(np.asarray(render_svg(other)), np.asarray(render_svg(text)))
    path = tmp_path / "short.svg"
    for content, is_ours in ((short, True), (minified(text), False), ("<!---->" + short, False)):
        path.write_text(content)
        assert may_replace(path) == is_ours
    keyed = write_svg(random_scene(kind, count=3), per_pixel=0.5, metadata="key")
    assert shortened(keyed) == keyed, "metadata stay"
    long = write_svg(random_scene(kind, count=40))
    assert len(long) > SHORT
    assert shortened(long) == long


def test_black_is_the_default_of_fills_but_not_of_strokes() -> None:
    for kind in Kind:
        scene = random_scene(kind, count=3)
        scene.colors[1] = 0
        black = replace(scene, canvas=replace(scene.canvas, background=np.zeros(3, np.float32)))
        assert '<rect width="4000" height="3600"/>' in write_svg(black)
        read = load_scene(write_svg(black), 40, 36, "a.svg")[0].canvas.background
        assert read is not None and not read.any()
        text = write_svg(scene)
        assert ("#000" in text) == (kind == Kind.STROKE)
        back, _ = load_scene(text, 40, 36, "a.svg")
        np.testing.assert_allclose(back.colors, rounded(scene, 100).colors, atol=1e-6)


def test_neighbours_of_one_colour_share_a_group() -> None:
    """With the same colour, the same line, or both."""
    for kind in Kind:
        scene = random_scene(kind, count=6)
        colors, widths = np.repeat(scene.colors[:2], 3, axis=0), np.full(6, scene.widths[0])
        scene = replace(scene, colors=colors, widths=widths, opacities=np.ones(6, np.float32))
        text = write_svg(scene, per_pixel=5)
        assert text.count(f' {kind.name.lower()}="#') == 2 + (kind == Kind.FILL)  # and the background's
        assert text.count("stroke-width") == (2 if kind == Kind.STROKE else 0)
        back, _ = load_scene(text, 40, 36, "a.svg")
        held = rounded(scene, 5)
        np.testing.assert_allclose(back.colors, held.colors, atol=1e-6)
        np.testing.assert_allclose(back.widths, held.widths, atol=1e-5)
        assert write_svg(back, per_pixel=5) == text


def test_paths_are_named_by_their_colours() -> None:
    """Each once; the picture is the same, and what is read as well."""
    scene = mixed_scene(seed=3)
    scene.colors[:3] = [[0, 0, 0.5], [0.01, 0, 0.52], [1, 0.84, 0]]
    text = write_svg(scene, per_pixel=5, ids=True)
    names = re.findall(r' id="([^"]*)"', text)
    assert len(names) == len(set(names)) == len(scene)
    assert names[:3] == ["navy", "navy-2", "gold"]
    plain = write_svg(scene, per_pixel=5)
    assert re.sub(r' id="[^"]*"', "", text) == plain
    back, _ = load_scene(text, 40, 36, "a.svg")
    assert write_svg(back, per_pixel=5) == plain
    ramps = write_svg(with_gradients(random_scene(Kind.FILL, 3)), ids=True)
    assert ' id="gradient"' in ramps and ' id="g0"' in ramps


def test_neighbours_of_one_colour_share_a_named_group() -> None:
    scene = mixed_scene(seed=3)
    fills = scene.take(np.flatnonzero(scene.kind == Kind.FILL)[[0, 1, 2, 0, 1, 2]])
    navy, gold = [0, 0, 0.5], [1, 0.84, 0]
    fills = replace(fills, colors=np.array([navy, navy, gold, navy, navy, gold], np.float32))
    text = write_svg(fills, per_pixel=5, ids=True)
    groups = re.findall(r'<g id="([^"]*)" fill="([^"]*)">(.*?)</g>(?=<g id|<path|</svg)', text)
    found = [(name, fill, re.findall('<path[^>]* id="([^"]*)"', inner)) for name, fill, inner in groups]
    assert found == [
        ("navy-group", "#000080", ["navy", "navy-2"]),
        ("navy-group-2", "#000080", ["navy-3", "navy-4"]),
    ]
    assert 'fill="#000080"' not in "".join(inner for _, _, inner in groups)
    assert (np.asarray(render_svg(text)) == np.asarray(render_svg(write_svg(fills, per_pixel=5)))).all()
    pens = write_svg(replace(fills, layer_names=("pen-1-000000",)), per_pixel=5, ids=True)
    assert "-group" not in pens and '<g id="pen-1-000000">' in pens


@pytest.mark.parametrize("title", ["", 'A <b> & "c" 100% #1 ä\u2028', "it's"])
def test_a_uri_holds_the_file(title: str) -> None:
    text = minified(write_svg(logo().scene, title=title))
    kind, comma, uri = data_uri(text).partition(",")
    assert (kind, comma) == ("data:image/svg+xml", ",")
    assert uri.isascii()
    assert not set('"<>#\n\\{}|^`') & set(uri)
    got, want = (ElementTree.tostring(ElementTree.fromstring(t)) for t in (unquote(uri), text))
    assert got == want
    if not title:
        assert len(uri) < 1.15 * len(text)
