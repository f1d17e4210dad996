"""Curves as arcs and as lines, and path data as the viewer reads it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from tests.svg.foreign import HEAD, ROUND, load_scene
from warpsplat.metrics import psnr
from warpsplat.svg.arcs import Vertices, as_arcs, as_lines, points_at
from warpsplat.svg.paths import cubics
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg

Floats = npt.NDArray[np.float64]

TOLERANCE = 0.01

QUARTER = [[(1, 0), (1, 0.5522848), (0.5522848, 1), (0, 1)]]
SHAPES = {
    "wave": [[(0, 0), (4, 6), (6, -6), (10, 0)]],
    "loop": [[(0, 0), (14, 9), (-4, 9), (10, 0)]],
    "cusp": [[(0, 0), (10, 10), (0, 10), (10, 0)]],
    "quarter": QUARTER,
    "without handles": [[(0, 0), (0, 0), (3, 4), (3, 4)]],
    "one handle": [[(0, 0), (0, 0), (5, 0), (5, 5)]],
    "there and back": [[(0, 0), (8, 0), (8, 0), (0, 0)]],
    "chain": [[(0, 0), (0, 3), (2, 5), (5, 5)], [(5, 5), (9, 5), (9, 0), (9, -3)]],
}


def drawn(vertices: Vertices, pieces: int = 50) -> Floats:
    """Return points along lines and arcs, by their angles."""
    found = [vertices.points[:1]]
    for a, b, bulge in zip(vertices.points[:-1], vertices.points[1:], vertices.bulges.tolist(), strict=True):
        t = np.arange(1, pieces + 1)[:, None] / pieces
        if bulge == 0:
            found.append(a + t * (b - a))
            continue
        angle = 4 * math.atan(bulge)
        centre = (a + b) / 2 + np.array([a[1] - b[1], b[0] - a[0]]) / (2 * math.tan(angle / 2))
        turn = t * angle
        x, y = (a - centre).tolist()
        found.append(
            centre + np.hstack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)])
        )
    return np.concatenate(found)


def farthest(points: Floats, others: Floats) -> float:
    """Return the largest distance of points from a polyline."""
    a, step = others[:-1], np.diff(others, axis=0)
    square = np.maximum((step * step).sum(axis=1), 1e-30)
    along = np.clip(((points[:, None] - a) * step).sum(axis=2) / square, 0, 1)
    gaps = points[:, None] - a - along[..., None] * step
    return float(np.sqrt((gaps * gaps).sum(axis=2)).min(axis=1).max())


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("make", [as_arcs, as_lines])
def test_nothing_is_farther_away_than_the_tolerance(name: str, make: type) -> None:
    curves = np.array(SHAPES[name], np.float64)
    made = make(curves, TOLERANCE)
    exact = points_at(curves, np.arange(401) / 400).reshape(-1, 2)
    own = drawn(made)
    assert farthest(exact, own) <= 1.1 * TOLERANCE
    assert farthest(own, exact) <= 1.1 * TOLERANCE
    assert np.array_equal(made.points[[0, -1]], exact[[0, -1]])
    assert len(made.bulges) == len(made.points) - 1 < 80


def test_arcs_have_no_corners() -> None:
    """Those of a curve without corners turn into each other."""
    steps = np.diff(drawn(as_arcs(np.array(SHAPES["wave"], np.float64), TOLERANCE), 400), axis=0)
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    assert np.abs(np.diff(headings)).max() < 0.02


def test_the_usual_forms_are_one_piece_each() -> None:
    arc = as_arcs(np.array(QUARTER, np.float64), TOLERANCE)
    assert len(arc.bulges) == 1 and arc.bulges[0] == pytest.approx(math.tan(math.pi / 8), abs=1e-3)
    line = as_arcs(np.array([[(0, 0), (1, 2), (2, 4), (3, 6)]], np.float64), TOLERANCE)
    assert line.bulges.tolist() == [0.0]
    assert line.points.tolist() == [[0, 0], [3, 6]]


def test_path_data_as_the_viewer_reads_it() -> None:
    """Every command, absolute and relative, smooth ones after others, arcs of all flags."""
    rng = np.random.default_rng(5)
    sizes = {"l": 2, "h": 1, "v": 1, "c": 6, "s": 4, "q": 4, "t": 2, "z": 0, "m": 2, "a": 7}
    for _ in range(12):
        data = "M20 15"
        for command in rng.choice([*sizes], 8):
            relative = rng.random() < 0.5
            v = [f"{x:.1f}" for x in rng.uniform(*((-15, 15) if relative else (3, 27)), sizes[command])]
            if command == "a":
                v[:3] = [f"{x:.1f}" for x in rng.uniform(2, 20, 3)]
                v[3:5] = [str(x) for x in rng.integers(0, 2, 2)]
            data += (command if relative else command.upper()) + " ".join(v)
        text = f'{HEAD}width="40" height="30"><path {ROUND} stroke-width="2" d="{data}"/></svg>'
        scene, _ = load_scene(text, 40, 30, data)
        written, shown = (on_white(render_svg(t)) for t in (write_svg(scene, per_pixel=1e4), text))
        assert psnr(written, shown) > 36, data


@pytest.mark.parametrize("turn", [0, 30, 77.7])
@pytest.mark.parametrize("sweep", [0, 1])
def test_an_arc_too_small_for_its_ends_is_half_an_ellipse(turn: float, sweep: int) -> None:
    (drawn,) = cubics(f"M1 2A3 1.5 {turn} 0 {sweep} 14.1 9.3", keep_dots=False)
    assert len(drawn.points) == 7
    angle = np.radians(turn)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    own = (drawn.points[::3] - [7.55, 5.65]) @ rotation
    sizes = np.hypot(own[:, 0] / 3, own[:, 1] / 1.5)
    assert np.allclose(sizes, sizes[0])
    (x, y), (far_x, far_y) = drawn.points[3] - drawn.points[0], drawn.points[6] - drawn.points[0]
    assert (x * far_y - y * far_x > 0) == (sweep == 1)
