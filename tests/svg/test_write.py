"""The file: numbers, paths, what comes back, and how independent viewers show it."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from xml.etree import ElementTree

import cairosvg
import numpy as np
import pytest
from PIL import Image

from tests.scenes import disc, random_scene
from warpsplat.kernels.constants import PLATEAU
from warpsplat.metrics import psnr
from warpsplat.render.backend import Backend
from warpsplat.render.models import SplatModel
from warpsplat.render.renderer import render
from warpsplat.scene import Kind
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import hex_color, join_numbers, number, path_data, read_metadata, write_svg

NUMBERS = [
    (0.0, 1, "0"),
    (-0.04, 1, "0"),
    (0.5, 1, ".5"),
    (-0.5, 1, "-.5"),
    (10.0, 1, "10"),
    (100.0, 0, "100"),
    (-20.26, 1, "-20.3"),
    (1.005, 3, "1.005"),
]


@pytest.mark.parametrize(("value", "decimals", "text"), NUMBERS)
def test_numbers(value: float, decimals: int, text: str) -> None:
    assert number(value, decimals) == text


def test_numbers_in_a_row() -> None:
    assert join_numbers(["1", "-2", "3", ".5", "1.5", ".5"]) == "1-2 3 .5 1.5.5"


def test_colors() -> None:
    assert hex_color(np.array([1, 1, 1], np.float32)) == "#fff"
    assert hex_color(np.array([0, 0.5, 1.2], np.float32)) == "#0080ff"


def test_rounding_does_not_add_up() -> None:
    """A thousand steps of 0.04 at one decimal: the end is at 40, not at 0."""
    points = np.stack([0.04 * np.arange(1000), np.zeros(1000)], axis=1).astype(np.float32)
    steps = [float(x) for x in path_data(points, Kind.STROKE, 1).split("c")[1].replace("-", " -").split()]
    # Each cubic is relative to the end of the one before.
    assert sum(steps[4::6]) == pytest.approx(40, abs=0.1)


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("precision", [0, 1, 2, 3])
def test_reads_back_what_it_writes(kind: Kind, precision: int) -> None:
    scene = random_scene(kind, count=9)
    canvas = scene.canvas
    text = write_svg(scene, precision=precision)
    back, _ = load_scene(text, canvas.width, canvas.height, "a.svg")
    np.testing.assert_array_equal(back.kind, scene.kind)
    np.testing.assert_array_equal(back.first, scene.first)
    np.testing.assert_allclose(back.points, scene.points, atol=0.51 * 10.0**-precision)
    np.testing.assert_allclose(back.colors, scene.colors, atol=0.51 / 255)
    opacities = [float(x) for x in re.findall(r'-opacity="([^"]*)"', text)]
    np.testing.assert_allclose(opacities, scene.opacities, atol=0.00051)
    np.testing.assert_allclose(back.opacities, opacities, atol=0.51 / 255)
    np.testing.assert_allclose(back.widths, scene.widths, atol=0.006)
    np.testing.assert_allclose(back.canvas.background, canvas.background, atol=0.51 / 255)


def test_document() -> None:
    text = write_svg(random_scene(Kind.STROKE, count=2), metadata="key=abc")
    root = ElementTree.fromstring(text)
    assert root.attrib["viewBox"] == "0 0 40 36"
    assert read_metadata(text).endswith("key=abc")
    group = root.find("{http://www.w3.org/2000/svg}g")
    assert group is not None
    assert group.attrib == {"fill": "none", "stroke-linecap": "round", "stroke-linejoin": "round"}
    assert len(group) == 2
    assert all(float(p.attrib["stroke-width"]) > 0 for p in group)


def test_opaque_shapes_need_no_opacity() -> None:
    scene = disc(10, 30, 15)
    scene.opacities[:] = 2.0
    assert "fill-opacity" not in write_svg(replace(scene, opacities=np.full(1, 0.9985, np.float32)))


@pytest.mark.parametrize("kind", list(Kind))
def test_the_file_looks_as_the_render(device: str, kind: Kind) -> None:
    """Painter's order, opacity, extent: for the exact model, and for splats of strong contrast."""
    scene = random_scene(kind, count=10, width=96, height=80, seed=3)
    backend = Backend.on(device)
    inner = on_white(render_svg(write_svg(scene, precision=2)))
    mine = render(scene, backend=backend).astype(np.float64) * 255
    assert psnr(mine, inner) > 42
    shown = on_white(render_svg(write_svg(scene, precision=2, opacity_scale=PLATEAU)))
    assert psnr(render(scene, model=SplatModel(), backend=backend).astype(np.float64) * 255, shown) > 30
    swapped = replace(scene, points=scene.take(np.arange(len(scene))[::-1]).points)
    assert psnr(mine, on_white(render_svg(write_svg(swapped)))) < 20


@pytest.mark.parametrize("kind", list(Kind))
def test_viewers_agree(kind: Kind) -> None:
    text = write_svg(random_scene(kind, count=12, width=96, height=80))
    other = cairosvg.svg2png(bytestring=text.encode())
    difference = np.abs(on_white(render_svg(text)) - on_white(Image.open(io.BytesIO(other))))
    assert difference.mean() < 0.01 * 255
