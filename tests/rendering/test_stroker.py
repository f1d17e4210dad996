"""Strokes with caps, joins and dashes: against float64, and pictures of many times the size."""

from __future__ import annotations

import itertools
import math

import cv2
import numpy as np
import pytest

import warpsplat
from tests.helpers import compare
from tests.scenes import DASHES, polyline_scene, random_scene, styled_scene
from warpsplat.errors import CapacityError
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Cap, FloatArray, Join, Kind, Scene
from warpsplat.scene.attributes import NO_DASHES
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg

STYLES = [(cap, join) for cap in Cap for join in Join if (cap, join) != (Cap.ROUND, Join.ROUND)]
DASHED = [
    (Cap.BUTT, Join.MITER, 0),
    (Cap.SQUARE, Join.BEVEL, 1),
    (Cap.ROUND, Join.ROUND, 2),
    (Cap.BUTT, Join.ROUND, 3),
]


@pytest.mark.parametrize(("cap", "join"), STYLES)
def test_image_and_gradients(device: str, cap: Cap, join: Join) -> None:
    compare(styled_scene(cap, join, seed=3).take(np.array([int(join)])), device)


@pytest.mark.parametrize(("cap", "join", "dash"), DASHED)
def test_image_and_gradients_of_dashes(device: str, cap: Cap, join: Join, dash: int) -> None:
    compare(styled_scene(cap, join, dash, seed=4).take(np.array([dash % 3])), device)


SQUARE = [
    (cap, join, dash)
    for cap, join, dash in itertools.product(Cap, Join, range(NO_DASHES, len(DASHES)))
    if (cap + join + dash) % 3 == 0
]
"""Every cap with every join, and each pattern of dashes with every cap and with every join."""


@pytest.mark.slow
@pytest.mark.parametrize(("cap", "join", "dash"), SQUARE)
def test_all_styles(device: str, cap: Cap, join: Join, dash: int) -> None:
    lanes = 64 if dash % 2 else 1
    compare(styled_scene(cap, join, dash, seed=6), device, 1.3, lanes=lanes)


ZIGZAG = [(8, 10), (40, 13), (15, 28), (50, 33), (45, 54), (12, 50)]
TRIANGLE = [(10, 14), (54, 18), (30, 54)]


def check_against_viewer(scene: Scene, device: str, least: float) -> None:
    """At least ``least`` dB from resvg's picture of eight times the size, reduced; and from its picture at
    this size hardly further than that is from the large one.
    """
    mine = 255 * render(scene, backend=Backend.on(device)).astype(np.float64)
    text, size = write_svg(scene), (scene.canvas.width, scene.canvas.height)
    viewer = on_white(render_svg(text))
    truth = cv2.resize(on_white(render_svg(text, zoom=8)), size, interpolation=cv2.INTER_AREA)
    assert psnr(mine, truth) > least
    assert psnr(mine, viewer) > min(psnr(truth, viewer) - 1.5, 38)


@pytest.mark.parametrize(("cap", "join"), STYLES)
def test_caps_and_joins_look_as_in_a_viewer(device: str, cap: Cap, join: Join) -> None:
    contours = [(ZIGZAG, False), (TRIANGLE, True)]
    for contour in contours:
        check_against_viewer(polyline_scene([contour], 7, cap=cap, join=join), device, 48)


@pytest.mark.parametrize("contour", [(ZIGZAG, False), (TRIANGLE, True)], ids=["open", "closed"])
@pytest.mark.parametrize(
    ("cap", "pattern"),
    [
        (Cap.BUTT, (0, 9, 5)),
        (Cap.BUTT, (-3, 12, 2, 3, 4)),
        (Cap.BUTT, (4, 1000, 8)),
        (Cap.ROUND, (4, 0, 11)),
        (Cap.SQUARE, (4, 0, 11)),
        (Cap.SQUARE, (23, 7, 9)),
    ],
)
def test_dashes_look_as_in_a_viewer(
    device: str, contour: tuple[list[tuple[int, int]], bool], cap: Cap, pattern: tuple[float, ...]
) -> None:
    scene = polyline_scene([contour], 5, cap=cap, join=Join.MITER, dash=0, dashes=(pattern,))
    check_against_viewer(scene, device, 42)


def test_mitres_end_at_the_limit(device: str) -> None:
    """A corner whose mitre is four times as long as the stroke is wide."""
    rise = 20 * math.tan(math.asin(1 / 4))
    corner = [(30, 32 - 1.5 * rise), (60, 32), (30, 32 + 1.5 * rise)]
    areas = []
    for limit in (3.99, 4.01):
        scene = polyline_scene(
            [(corner, False)], 4, (80, 64), cap=Cap.BUTT, join=Join.MITER, miter_limits=limit
        )
        check_against_viewer(scene, device, 48)
        areas.append(render(scene, backend=Backend.on(device))[..., 0].sum())
    # The rhombus between the two segments' ends and the tip, less the triangle of the bevel.
    tall = 2 * 2 * math.cos(math.asin(1 / 4))
    tip = 4 * 4 / 2 - 2 / 4
    assert areas[1] - areas[0] == pytest.approx(tall * tip / 2, rel=0.02)


@pytest.mark.parametrize(("cap", "area"), [(Cap.BUTT, 0), (Cap.ROUND, math.pi * 9), (Cap.SQUARE, 36)])
def test_dots(device: str, cap: Cap, area: float) -> None:
    """Contours without length; and dashes without, on a slanted line that has room for three."""
    point = polyline_scene([([(20.3, 19.6)] * 2, False)], 6, cap=cap, join=Join.MITER)
    assert render(point, backend=Backend.on(device))[..., 0].sum() == pytest.approx(area, rel=0.02)
    dots = polyline_scene(
        [([(10, 10), (40, 30)], False)], 6, cap=cap, join=Join.MITER, dash=0, dashes=((3.0, 0, 13),)
    )
    image = render(dots, backend=Backend.on(device))[..., 0]
    assert image.sum() == pytest.approx(3 * area, rel=0.02)


@pytest.mark.parametrize("join", Join)
def test_a_line_that_turns_back(device: str, join: Join) -> None:
    """Only a round join reaches beyond the cusp; a mitre would be endless."""
    scene = polyline_scene([([(10, 20), (40, 20), (10, 20)], False)], 8, cap=Cap.BUTT, join=join)
    area = render(scene, backend=Backend.on(device))[..., 0].sum()
    assert area == pytest.approx(30 * 8 + (math.pi * 8 if join == Join.ROUND else 0), rel=0.005)


def test_dashes_too_short_to_be_seen_are_seen_in_the_mean(device: str) -> None:
    scene = polyline_scene(
        [([(8, 20), (56, 20)], False)], 6, cap=Cap.BUTT, join=Join.MITER, dash=0, dashes=((0, 0.025, 0.075),)
    )
    image = render(scene, backend=Backend.on(device))[..., 0]
    np.testing.assert_allclose(image[17:23, 8:56], 0.25, atol=1e-3)


def test_more_dashes_than_there_is_room_for(device: str) -> None:
    line = [(-4e6, 20), (4e6, 20)]
    scene = polyline_scene([(line, False)], 6, cap=Cap.BUTT, join=Join.MITER, dash=0, dashes=((0, 0.3, 0.3),))
    with pytest.raises(CapacityError, match="samples"):
        render(scene, backend=Backend.on(device))


def test_beside_fills_and_round_strokes(device: str) -> None:
    """The parts of a coverage keep to their shapes."""
    scene = random_scene(Kind.FILL, 1, seed=3).append(
        styled_scene(Cap.BUTT, Join.MITER, seed=1).take(np.arange(1))
    )
    compare(scene.append(random_scene(Kind.STROKE, 1, seed=4)), device)


FINER = 16
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 96 96" fill="none" stroke="green">'
POLYGON = '<polygon points="10 20 80 88 15 74" {}/>'
CIRCLE = '<circle cx="48" cy="48" r="36" stroke-width="6" stroke-dasharray="10 20" {}/>'
LINE = '<path d="M8 20 88 70 20 84" stroke-width="3" stroke-dasharray="7 5" {}/>'


def worst_psnr(a: FloatArray, b: FloatArray) -> float:
    """On black and on white, the lower one; both are premultiplied."""
    papers = [a[..., :3] - b[..., :3] + paper * (b[..., 3:] - a[..., 3:]) for paper in (0, 1)]
    return float(min(-10 * np.log10(np.square(error, dtype=np.float64).mean()) for error in papers))


def truth(svg: str) -> FloatArray:
    """Return a viewer's picture, reduced."""
    large = warpsplat.render(svg, renderer="viewer", scale=FINER)
    height, width = (side // FINER for side in large.shape[:2])
    return np.asarray(large.reshape(height, FINER, width, FINER, 4).mean(axis=(1, 3)), np.float32)


@pytest.mark.parametrize(
    ("body", "right", "wrong", "least"),
    [
        (POLYGON, "", 'stroke-width="1.05"', 60),
        (POLYGON, 'stroke-width="4"', 'stroke-width="4" stroke-linejoin="bevel"', 55),
        (LINE, "", 'stroke-dashoffset="0.1"', 60),
        (LINE, 'stroke-dashoffset="2.5"', 'stroke-dashoffset="2.6"', 60),
        (LINE, 'stroke-dashoffset="-2.5"', 'stroke-dashoffset="-2.4"', 60),
        (CIRCLE, "", 'stroke-dashoffset=".3"', 38),
        (CIRCLE, 'stroke-dashoffset="20%"', 'stroke-dashoffset="19.5"', 38),
        (CIRCLE, 'stroke-dashoffset="-15"', 'stroke-dashoffset="-14.7"', 38),
        (CIRCLE, 'stroke-dashoffset="1.5mm"', 'stroke-dashoffset="5.97"', 38),
    ],
)
def test_exact_renders_are_nearer_to_supersampling_than_a_viewer(
    device: str, body: str, right: str, wrong: str, least: float
) -> None:
    """Hairlines and dashes; where they are a little elsewhere, it shows."""
    svg = f"{HEAD}{body.format(right)}</svg>"
    wanted, shown = truth(svg), warpsplat.render(svg, renderer="exact", device=device)
    viewer = warpsplat.render(svg, renderer="viewer")
    assert worst_psnr(shown, wanted) > max(least, worst_psnr(viewer, wanted) + 3)
    other = warpsplat.render(f"{HEAD}{body.format(wrong)}</svg>", renderer="exact", device=device)
    assert worst_psnr(other, wanted) < least
