"""Strokes that end at others end on their centre lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import vectorized
from tests.drawing.trace.line_art import TEE, drawn
from warpsplat.drawing.junctions import with_junctions
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.svg.data import straight_cubics


def strokes(*cubics: list[tuple[float, float]], width: float = 4) -> Scene:
    """Strokes of one cubic each; of two points, a line."""
    points = [np.array(c) if len(c) == 4 else np.linspace(c[0], c[-1], 4) for c in cubics]
    scene = Scene.uniform(Kind.STROKE, Canvas(96, 72, None), np.array(points, np.float32))
    return replace(scene, widths=np.full(len(cubics), width, np.float32))


BAR = [(10, 20), (86, 20)]


@pytest.mark.parametrize(
    ("end", "met"), [((48, 21.4), (48, 20)), ((48, 18.5), (48, 20)), ((37, 21.5), (36.2105, 20))]
)
def test_an_end_in_the_ink_of_another_is_put_on_its_centre_line(
    end: tuple[float, float], met: tuple[float, float]
) -> None:
    scene = strokes(BAR, [end, (48 if end[0] == 48 else 60, 65.2)])
    made = with_junctions(scene)
    stem = made.points_of(1)
    assert stem[0] == pytest.approx(met, abs=1e-3)
    assert straight_cubics(made, made.points.astype(np.float64))[[0, 4]].all(), "lines stay lines"
    assert (made.points_of(0) == scene.points_of(0)).all() and (stem[3] == scene.points_of(1)[3]).all()


def test_a_curve_goes_on_as_it_is_bent() -> None:
    """On an arc of a circle, about, its end stays on the circle."""
    arc = [(68, 41), (68, 29.9543), (59.0457, 21), (48, 21)]
    end = with_junctions(strokes([(46.5, 10), (46.5, 60)], arc)).points_of(1)[3]
    assert end[0] == pytest.approx(46.5, abs=1e-3)
    assert np.hypot(*(end - (48, 41))) == pytest.approx(20, abs=0.1)


def test_a_short_handle_does_not_throw_a_curve_off() -> None:
    curve = [(48, 18.5), (48, 18.52), (60, 50), (70, 60)]
    made = with_junctions(strokes(BAR, curve)).points_of(1)
    assert made == pytest.approx(np.array([(48, 20), *curve[1:]]), abs=2)


@pytest.mark.parametrize(
    "other",
    [
        [(48, 23), (48, 60)],  # beside the ink
        [(20, 21), (80, 21.5)],  # along it
        [(48, 10), (48, 60)],  # across it
        [(48, 21), (48, 21)],  # a dot
    ],
)
def test_other_ends_stay(other: list[tuple[float, float]]) -> None:
    scene = strokes(BAR, other)
    assert (with_junctions(scene).points == scene.points).all()


SLANTED = '<path d="M12 12L84 24"/><path d="M40 16.667L56 64"/>'


@pytest.mark.parametrize("paths", [TEE, SLANTED, SLANTED.replace("<path", '<path stroke-width="5"', 1)])
@pytest.mark.parametrize("is_grey", [True, False])
def test_a_line_that_ends_at_another_ends_on_its_centre_line(paths: str, is_grey: bool, device: str) -> None:
    image = drawn(paths)
    scene = vectorized(image if is_grey else np.round(image), device, "line").scene
    bar, stem = sorted(map(scene.points_of, range(2)), key=lambda points: -float(np.ptp(points[:, 0])))
    low = stem[stem[:, 1].argmin()]
    first, last = bar[bar[:, 0].argmin()], bar[bar[:, 0].argmax()]
    way = (last - first) / np.hypot(*(last - first))
    off = low - first
    assert abs(off[0] * way[1] - off[1] * way[0]) < 0.15
