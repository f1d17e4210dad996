"""Shapes of many nodes as several paths that show the same."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import mixed_scene
from tests.svg.foreign import HEAD
from warpsplat.scene import Kind, Scene
from warpsplat.svg.parts import in_parts
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import render_svg
from warpsplat.svg.write import write_svg


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
