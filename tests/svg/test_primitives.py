"""Outlines that are circles, ellipses and rectangles are written as such."""

from __future__ import annotations

import re

import numpy as np
import pytest

from warpsplat.scene import Basis, Canvas, Kind, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.primitives import Primitive, primitives
from warpsplat.svg.read import load_scene
from warpsplat.svg.write import rounded, write_svg

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
