"""Outlines as DXF."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest

from tests.svg.foreign import HEAD, load_scene
from warpsplat.errors import ImageError
from warpsplat.svg.dxf import CURVES, TOLERANCE, draw_dxf
from warpsplat.svg.page import on_sheet, sheet_for
from warpsplat.svg.write import write_svg

pytest.importorskip("ezdxf")

PIXEL = 25.4 / 96

DRAWING = f"""{HEAD}width="40mm" height="30mm" viewBox="0 0 400 300">
<rect width="400" height="300" fill="#fff"/>
<path d="M50 50H350V250H50z M100 100V200H200V100z" fill="#c00"/>
<path d="M220 180Q300 20 340 180C330 260 240 240 220 180z" fill="#08f"/>
<circle cx="300" cy="150" r="25" fill="#fc0"/>
<path d="M20 280Q200 200 380 280" fill="none" stroke="#609" stroke-width="8"/>
</svg>"""
"""A background, a hole, curves, a circle, and a stroke."""

AREA = 10 * (30 * 20 - 10 * 10)
"""Area of the first path [0.1 mm2]."""


def read(text: str, curves: str = "arcs", zoom: float = 1.0) -> Any:
    """Return the document, without faults."""
    import ezdxf

    document = ezdxf.read(io.StringIO(draw_dxf(text, curves, zoom=zoom).decode()))
    audit = document.audit()
    assert not audit.errors and not audit.fixes
    return document


def points_of(entity: Any) -> np.ndarray:
    """Return points along an entity."""
    from ezdxf import path

    return np.array([(p.x, p.y) for p in path.make_path(entity).flattening(1e-4)])


def is_closed(entity: Any) -> bool:
    kind = entity.dxftype()
    if kind in {"LWPOLYLINE", "SPLINE"}:
        return bool(entity.closed)
    return bool(kind == "CIRCLE" or entity.is_closed)


def area(points: np.ndarray) -> float:
    x, y = points.T
    return abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())) / 2


KINDS = {"arcs": "LWPOLYLINE", "splines": "SPLINE", "lines": "LWPOLYLINE", "r12": "POLYLINE"}


@pytest.mark.parametrize("curves", CURVES)
def test_contours_are_closed_entities_in_millimetres_upwards(curves: str) -> None:
    document = read(DRAWING, curves)
    entities = list(document.modelspace())
    straight = "POLYLINE" if curves == "r12" else "LWPOLYLINE"
    assert [e.dxftype() for e in entities] == [straight, straight, KINDS[curves], "CIRCLE", KINDS[curves]]
    assert [e.dxf.layer for e in entities] == ["CC0000", "CC0000", "0088FF", "FFCC00", "660099"]
    assert [is_closed(e) for e in entities] == [True] * 4 + [False]
    outer, hole, curved, circle, stroke = map(points_of, entities)
    assert np.allclose([outer.min(axis=0), outer.max(axis=0)], [[5, 5], [35, 25]])
    assert np.allclose([hole.min(axis=0), hole.max(axis=0)], [[10, 10], [20, 20]])
    assert area(outer) == pytest.approx(600)
    assert area(circle) == pytest.approx(np.pi * 2.5**2, rel=1e-3)
    assert np.allclose(stroke[[0, -1]], [[2, 2], [38, 2]])
    scene, _ = load_scene(DRAWING, 4000, 3000, "drawing")
    from warpsplat.scene.geometry import areas

    # Areas of a scene are those of 8 pieces to a curve.
    assert area(curved) == pytest.approx(areas(scene)[1] / 1e4, rel=0.02)
    if curves != "splines":  # all are within the tolerance of these
        exact = points_of(list(read(DRAWING, "splines").modelspace())[2])
        gaps = np.sqrt(((curved[:, None] - exact) ** 2).sum(axis=2)).min(axis=1)
        assert gaps.max() < TOLERANCE * 40 + np.sqrt(((exact[1:] - exact[:-1]) ** 2).sum(axis=1)).max() / 2


@pytest.mark.parametrize("curves", CURVES)
def test_head_and_layers(curves: str) -> None:
    document = read(DRAWING, curves, 2.0)
    assert tuple(document.header["$EXTMIN"])[:2] == (0, 0)
    assert tuple(document.header["$EXTMAX"])[:2] == pytest.approx((80, 60))
    layer = document.layers.get("CC0000")
    assert layer.color == 12
    if curves == "r12":
        assert document.dxfversion == "AC1009"
    else:
        assert document.units == 4, "millimetres"
        assert layer.rgb == (0xCC, 0, 0)
    assert draw_dxf(DRAWING, curves) == draw_dxf(DRAWING, curves)


@pytest.mark.parametrize(
    ("size", "width"),
    [
        ('width="96" height="48"', 25.4),
        ('width="2in" height="1in" viewBox="0 0 7 3.5"', 50.8),
        ('viewBox="0 0 96 48"', 25.4),
        ('width="4cm" viewBox="0 0 8 4"', 40),
    ],
)
def test_the_size_is_that_of_the_svg(size: str, width: float) -> None:
    (entity,) = read(f'{HEAD}{size}><rect width="50%" height="50%"/></svg>').modelspace()
    points = points_of(entity)
    assert np.allclose([points.min(axis=0), points.max(axis=0)], [[0, width / 4], [width / 2, width / 2]])


@pytest.mark.parametrize(
    ("shapes", "expected"),
    [
        ('<path d="M1 1H9V9z" fill="red" stroke="red"/>', [("FF0000", True)]),
        ('<path d="M1 1H9V9z" fill="red" stroke="#00f"/>', [("FF0000", True), ("0000FF", True)]),
        ('<path d="M1 1H9V9" fill="red" stroke="#00f"/>', [("FF0000", True), ("0000FF", False)]),
        ('<path d="M1 1H9V9z" fill="red" fill-opacity="0"/>', []),
        ('<path d="M1 1H9" stroke="red"/>', [("FF0000", False)]),
        ('<path d="M1 1H9V9z" fill="red" fill-opacity=".3"/>', [("FF0000", True)]),
    ],
)
def test_which_shapes_become_entities(shapes: str, expected: list[tuple[str, bool]]) -> None:
    entities = read(f'{HEAD}width="10" height="10">{shapes}</svg>').modelspace()
    assert [(e.dxf.layer, is_closed(e)) for e in entities] == expected


def test_dots_and_gradients() -> None:
    text = (
        f'{HEAD}width="10" height="10"><linearGradient id="g"><stop stop-color="red"/><stop offset="1" '
        'stop-color="#00f"/></linearGradient><path d="M1 1H9V9z" fill="url(#g)"/>'
        '<path d="M4 4z" stroke="#0f0" stroke-linecap="round"/></svg>'
    )
    fill, dot = read(text).modelspace()
    assert fill.dxf.layer in {"800080", "7F007F"}
    assert dot.dxftype() == "POINT"
    assert tuple(dot.dxf.location)[:2] == pytest.approx((4 * PIXEL, 6 * PIXEL), abs=1e-6)


def test_fills_end_at_the_page() -> None:
    (entity,) = read(f'{HEAD}width="10" height="10"><path d="M-5 5H5V20H-5z"/></svg>').modelspace()
    points = points_of(entity) / PIXEL
    assert np.allclose([points.min(axis=0), points.max(axis=0)], [[0, 0], [5, 5]], atol=1e-5)


def test_a_background_on_a_sheet_is_left_out() -> None:
    scene, _ = load_scene(
        f'{HEAD}width="10" height="10"><rect width="10" height="10" fill="#ff0"/><path d="M1 1H9V9z"/></svg>',
        10,
        10,
        "drawing",
    )
    text = on_sheet(
        write_svg(scene, per_pixel=10.0), sheet_for("", "a4", "", scene.canvas.width, scene.canvas.height)
    )
    (entity,) = read(text).modelspace()
    assert np.ptp(points_of(entity), axis=0) == pytest.approx(
        [152, 152], rel=5e-3
    )  # margins are in whole units


def test_attributes_that_change_only_edges_are_accepted() -> None:
    """Pixel art on a sheet, and strokes of an image with other resolutions along than down."""
    text = (
        f'{HEAD}width="20" height="10" viewBox="0 0 7 7" preserveAspectRatio="none" '
        'shape-rendering="crispEdges">'
        '<path d="M0 0H7V7H0z"/><path d="M0 0L7 7" stroke="red"/></svg>'
    )
    cell, stroke = read(text).modelspace()
    assert np.allclose(points_of(cell).max(axis=0), [20 * PIXEL, 10 * PIXEL])
    assert np.allclose(points_of(stroke), np.array([[0, 10], [20, 0]]) * PIXEL, atol=1e-6)


def test_other_elements_are_refused() -> None:
    with pytest.raises(ImageError, match="<text>"):
        draw_dxf(f'{HEAD}width="9" height="9"><text>a</text></svg>', "arcs")
