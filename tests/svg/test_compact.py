"""Files with fewer characters, or of smaller paths, that show the same; and their sizes."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, GOLD, RED, ROUND, WHITE, Outline, disc, drawing, logo, polygon, star
from tests.scenes import mixed_scene
from tests.svg.foreign import HEAD, load_scene
from warpsplat.scene import Basis, Canvas, Kind, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.parts import in_parts
from warpsplat.svg.primitives import Primitive, primitives
from warpsplat.svg.sizes import estimated_size
from warpsplat.svg.viewer import render_own, render_svg
from warpsplat.svg.write import rounded, write_svg


def moved(outline: Outline, x: float, y: float) -> Outline:
    return outline[0] + (x, y), outline[1]


def starred() -> Scene:
    """Two colours of stars with a hole, one of them other than the others, among discs."""
    hole = disc(0, 0, 3, 0.4)[0][::-1][[-1, *range(11)]], ROUND * 4
    places = [(12, 12), (34.4, 12.3), (58.1, 13), (12, 40), (35, 41.7)]
    rings = [[moved(one, x, y) for one in (star(0, 0, 9, 5), hole)] for x, y in places]
    odd = moved(star(0, 0, 9, 4), 58, 40)
    first = [one for pair in rings[:3] for one in pair]
    made = drawing(
        Canvas(80, 56, WHITE),
        (RED, [*first, odd]),
        (GOLD, [moved(disc(0, 0, 5), 70, 30), *rings[3]]),
        (BLUE, rings[4]),
    )
    return replace(made.scene, opacities=np.array([1, 0.5, 1], np.float32))


def test_equal_outlines_are_written_once() -> None:
    """By all shapes that have them, whatever their colours, and the picture stays."""
    scene = rounded(starred(), 10)
    plain, text = write_svg(scene, per_pixel=10), write_svg(scene, per_pixel=10, symbols=True)
    assert text.count("<use ") == 5
    assert text.count(' id="') == 1
    assert len(text) < 0.8 * len(plain)
    a, b = (np.asarray(render_own(one), float) for one in (plain, text))
    assert np.abs(a - b).max() <= 2
    back, _ = load_scene(text, 80, 56, "a.svg")
    assert len(back.points) == len(scene.points)
    assert write_svg(back, per_pixel=10, symbols=True).count("<use ") == 5


def test_single_outlines_and_discs_are_not_shared() -> None:
    """Outlines that occur once, and discs, which an element describes."""
    scene = drawing(Canvas(80, 56, WHITE), (RED, [star(20, 20, 9, 5)]), (BLUE, [disc(60, 30, 5)])).scene
    assert "<use" not in write_svg(rounded(scene, 10), per_pixel=10, symbols=True)


def square(x: float, y: float, side: float) -> str:
    return f"M{x} {y}h{side}v{side}h-{side}z"


def squares(rings: list[str]) -> Scene:
    """One even-odd shape of translucent rings between two others."""
    shapes = [(square(0, 0, 60), 1.0), ("".join(rings), 0.5), (square(4, 4, 20), 0.4)]
    paths = (f'<path fill="#e80" fill-rule="evenodd" fill-opacity="{alpha}" d="{d}"/>' for d, alpha in shapes)
    return load_scene(f'{HEAD}width="64" height="48">{"".join(paths)}</svg>', 64, 48, "a.svg")[0]


GRID = [square(x, y, 8) for y in (2, 14, 26) for x in (2, 14, 26, 38)]
HOLES = [square(x + 2, y + 2, 4) for y in (2, 14, 26) for x in (2, 14, 26, 38)]


@pytest.mark.parametrize("most", [8, 16, 40])
def test_parts_look_the_same_and_are_small(most: int) -> None:
    scene = squares([*GRID, *HOLES])
    made = in_parts(scene, most)
    contours = np.diff(np.searchsorted(made.starts, made.first))
    assert (4 * contours <= most).all()
    assert len(made) == 2 + -(-96 // (most // 8 * 8))
    split, whole = (np.asarray(render_svg(write_svg(one, per_pixel=10))) for one in (made, scene))
    assert (split == whole).all()


def test_a_hole_stays_with_what_is_around_it() -> None:
    scene = squares([square(2, 2, 40), square(10, 10, 8), square(50, 10, 4)])
    made = in_parts(scene, 4)
    assert np.diff(np.searchsorted(made.starts, made.first)).tolist() == [1, 2, 1, 1]
    assert made.opacities.tolist() == [1, 0.5, 0.5, scene.opacities[2]]


def test_contours_that_nearly_touch_or_share_a_neighbour_stay_together() -> None:
    assert len(in_parts(squares([square(2, 2, 8), square(30, 2, 8), square(6, 6, 28)]), 4)) == 3
    assert len(in_parts(squares([square(2, 2, 8), square(10.9, 2, 8)]), 4)) == 3
    assert len(in_parts(squares([square(2, 2, 8), square(11.1, 2, 8)]), 4)) == 4


def test_small_shapes_and_twins_stay_whole() -> None:
    scene = mixed_scene(seed=3)
    for small in (scene, scene.take(np.zeros(0, np.intp))):
        assert in_parts(small) is small
    pair = squares(GRID).take(np.array([1, 1]))
    twins = replace(pair, twin=np.array([0, 1], np.int32), kind=np.array([Kind.FILL, Kind.STROKE], np.int32))
    assert in_parts(twins, 8) is twins


def test_files_have_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = squares([*GRID, *HOLES])
    assert write_svg(scene, per_pixel=10).count("evenodd") == 3
    monkeypatch.setattr(in_parts, "__defaults__", (40,))
    text = write_svg(scene, per_pixel=10, ids=True)
    assert text.count("evenodd") == 5
    names = re.findall(r'<(?:path|rect)[^>]* id="([^"]*)"', text)
    assert len(set(names)) == 5


CIRCLE = Primitive((8.21, 6.2), (28.41, 26.4), (10.1, 10.1))
HOLE = Primitive((13.3, 11.2), (23.3, 21.2), (5, 5), is_clockwise=False)
ELLIPSE = Primitive((40, 5), (60, 15.2), (10, 5.1))
ROUNDED = Primitive((40.1, 20), (70, 32.2), (2.6, 2.6), is_clockwise=False)
PILL = Primitive((5, 40), (35.3, 50), (5, 5))
RECTANGLE = Primitive((45, 40), (60, 50.5), (0, 0))


def scene_of(*shapes: list[Primitive]) -> Scene:
    contours = [[one.cubics()[:, :3].reshape(-1, 2) for one in shape] for shape in shapes]
    flat = [points for shape in contours for points in shape]
    return Scene(
        Canvas(96, 64, np.ones(3, np.float32)),
        np.full(len(shapes), Kind.FILL, np.int32),
        starts_of(np.array([sum(map(len, shape)) for shape in contours])),
        np.full(len(shapes), Basis.CUBIC, np.int32),
        points=np.concatenate([np.roll(points, 3 * i, axis=0) for i, points in enumerate(flat)]).astype(
            np.float32
        ),
        starts=starts_of(np.array([len(points) for points in flat])),
        closed=np.ones(len(flat), np.int32),
        colors=np.linspace(0, 0.9, 3 * len(shapes), dtype=np.float32).reshape(-1, 3),
        opacities=np.ones(len(shapes), np.float32),
    )


@pytest.mark.parametrize("per_pixel", [1, 10, 100])
def test_files_have_elements_and_come_back(per_pixel: float) -> None:
    """Alone in a path they are elements, with others arcs; what is read is written as the same bytes."""
    scene = scene_of([CIRCLE, HOLE], [ELLIPSE], [ROUNDED], [PILL], [RECTANGLE], [CIRCLE], [ROUNDED, PILL])
    text = write_svg(scene, per_pixel=per_pixel)
    assert re.findall("<([a-z]+) ", text.partition("/>")[2]) == [
        "path",
        "ellipse",
        "rect",
        "rect",
        "rect",
        "circle",
        "path",
    ]
    assert not re.search("[cs]", "".join(re.findall(' d="([^"]*)"', text)))
    assert len(re.findall(' rx="', text)) == 3
    back, _ = load_scene(text, 96, 64, "a.svg")
    assert write_svg(back, per_pixel=per_pixel) == text
    held = rounded(scene, per_pixel)
    assert write_svg(held, per_pixel=per_pixel) == text
    assert np.abs(held.points - scene.points).max() <= 1.01 / per_pixel


def test_other_outlines_stay_paths() -> None:
    """A handle off by a tenth of a pixel, an arc that bulges inwards, a slanting side."""
    for row, by in ((1, (0.0, 0.1)), (4, (-0.1, 0.0)), (0, (1.0, 0.0))):
        scene = scene_of([ELLIPSE])
        scene.points[row] += np.array(by, np.float32)
        assert not list(primitives(scene, 10.0 * scene.points.astype(np.float64)))
    scene = scene_of([RECTANGLE])
    scene.points[0] += np.array([1, 0], np.float32)
    assert "<rect x" not in write_svg(scene, per_pixel=10)


@pytest.mark.parametrize("per_pixel", [1.0, 3.0, 10.0, 50.0])
def test_about_the_bytes_of_a_file(per_pixel: float) -> None:
    """For a picture of lines, arcs and curves, and as many of them as words need."""
    rng = np.random.default_rng(0)
    corners = 200 * rng.random((40, 7, 2))
    outlines = [polygon(*ring.tolist()) for ring in corners]
    many = drawing(Canvas(200, 200, WHITE), *[(color, outlines) for color in (RED, BLUE, GOLD)]).scene
    shaken = logo().scene
    points = shaken.points + rng.normal(0, 0.3, shaken.points.shape).astype(np.float32)
    discs = drawing(Canvas(64, 64, WHITE), (RED, [disc(20, 20, 8)]), (BLUE, [disc(40, 44, 11)])).scene
    for scene in (many, shaken, replace(shaken, points=points), discs):
        assert estimated_size(scene, per_pixel) == pytest.approx(
            len(write_svg(scene, per_pixel=per_pixel)), rel=0.12
        )
