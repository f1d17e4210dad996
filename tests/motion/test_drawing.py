"""The order of drawing, moving elements, and the tracking of shapes."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.scenes import forms_scene, mixed_scene, with_gradients
from warpsplat.motion import drawing
from warpsplat.motion.follow import track_shapes
from warpsplat.motion.moving import moving_elements
from warpsplat.scene import Basis, Scene
from warpsplat.svg.viewer import on_white, render_own

TWO_STROKES = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="48" height="36" viewBox="0 0 480 360"><!--warpsplat-->\n'
    '<rect width="480" height="360" fill="#fff"/><g fill="none" stroke="#000" stroke-width="20">'
    '<path d="M40 100h300"/><path d="M40 200h100"/></g><path d="M40 300h100v40h-100z"/></svg>\n'
)


def test_strokes_grow_one_after_the_other() -> None:
    """Times are proportional to lengths; a fill takes as long as the mean stroke."""
    film = drawing.film(TWO_STROKES, Path("a.webp"), 48, 3.0, own=True)
    frames = [on_white(picture) for picture, _ in film]
    # Columns of dark pixels in the rows of the two strokes and of the fill.
    found = np.array([(frame[[10, 20, 31], :, 0] < 128).sum(axis=1) for frame in frames])
    assert np.all(np.diff(found, axis=0) >= 0)
    assert found[-1] == pytest.approx([30, 10, 10], abs=1)
    # Of three equal times, the strokes have two, 3:1.
    assert found[len(found) // 2 - 1] == pytest.approx([30, 0, 0], abs=1)
    assert found[round(len(found) / 4), 0] == pytest.approx(15, abs=2.5)
    assert np.array_equal(frames[-1], on_white(render_own(TWO_STROKES)))
    assert (frames[0] > 250).mean() > 0.98, "the background is there from the beginning"


def test_foreign_files_are_drawn_with_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpsplat.motion.films.render_own", None)
    frames = list(drawing.film(TWO_STROKES, Path("a.gif"), 24, 0.16, own=False))
    assert [picture.size for picture, _ in frames] == [(24, 18)] * 3


def test_the_svg_shows_the_file_where_nothing_is_animated() -> None:
    text = drawing.animated_svg(TWO_STROKES, 3.0)
    assert np.array_equal(np.asarray(render_own(text)), np.asarray(render_own(TWO_STROKES)))
    assert 'style="animation-delay:0s;animation-duration:1.5s;--l:300px" class="ws"' in text
    assert 'style="animation-delay:1.5s;animation-duration:.5s;--l:100px" class="ws"' in text
    assert 'style="animation-delay:2s" class="wf"' in text
    assert "<script" not in text and "prefers-reduced-motion" in text


def test_own_styles_and_classes_stay() -> None:
    other = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        'width="9" height="9">'
        '<defs><path id="a" d="M0 0h9"/></defs>'
        '<use xlink:href="#a" class="x" style="stroke:red;"/>'
        '<path d="M0 5h9" style="fill:none;stroke:red" stroke-dasharray="1 2"/></svg>'
    )
    text = drawing.animated_svg(other, 1.0)
    assert 'class="x wf" style="stroke:red;animation-delay:0s"' in text
    assert 'style="fill:none;stroke:red;animation-delay:.5s" stroke-dasharray="1 2" class="wf"' in text
    assert '<path id="a" d="M0 0h9" />' in text, "not drawn where it stands"
    assert np.array_equal(np.asarray(render_own(text)), np.asarray(render_own(other)))


SCENE = mixed_scene()
LESS, MOVED = SCENE.take(np.arange(1, len(SCENE))), replace(SCENE, points=SCENE.points + np.float32(1))


def made(*scenes: Scene) -> tuple[list[str], str]:
    """Return lines of elements in 400 units, with keyframes a second apart, and the rules."""
    static = "<static {}/>".format
    text, rules = moving_elements(
        scenes, range(len(scenes)), 1.0, 400.0, lambda scene: static(scene.opacities[0])
    )
    return text.splitlines(), rules


def places(line: str, begin: int = 0) -> list[str]:
    """Return the path data of a moving path by keyframe."""
    found = re.search(rf'<animate attributeName="d" begin="{begin}s" [^>]*values="([^"]*)"', line)
    assert found
    return found[1].split(";")


def commands(data: str) -> list[tuple[str, int]]:
    rows = re.findall("([a-zA-Z])([^a-zA-Z]*)", data)
    return [(letter, len(re.findall(r"-?\d+", row))) for letter, row in rows]


def test_paths_move_with_equal_commands() -> None:
    lines, _ = made(SCENE, MOVED, SCENE)
    assert len(lines) == len(SCENE)
    for line in lines:
        first, second, third = places(line)
        assert first == third != second and f'd="{third}"' in line
        assert commands(first) == commands(second)
        x, y, u, v = (int(n) for part in (first, second) for n in re.findall(r"-?\d+", part)[:2])
        assert abs(u - x - 10) <= 2 and abs(v - y - 10) <= 2, "400 units on a canvas of 40"


def test_forms_move_as_their_outlines() -> None:
    scene = forms_scene()
    lines, rules = made(scene, replace(scene, points=scene.points + np.float32(1)))
    drawn = [each.drawn() for each in (scene, replace(scene, points=scene.points + np.float32(1)))]
    assert (lines, rules) == made(*drawn)
    assert all(len(set(places(line))) == 2 for line in lines)


def test_shapes_fade_in_and_out() -> None:
    lines, _ = made(LESS, SCENE, SCENE, LESS)
    fading = [line for line in lines if "animation:" in line]
    assert len(fading) == 1 and fading[0] is not lines[-1]
    assert 'animation:i 1s linear 0s backwards,o 1s linear 2s forwards"' in fading[0]


@pytest.mark.parametrize("opacity", [1.0, 0.9, 0.6])
def test_an_opaque_element_stays_until_its_successor_is_there(opacity: float) -> None:
    scene = with_gradients(SCENE)
    ones = np.ones_like(scene.stop_opacities)
    scene = replace(scene, opacities=np.full_like(scene.opacities, opacity), stop_opacities=ones)
    lines, _ = made(scene, replace(scene, opacities=scene.opacities - np.float32(0.01)))
    groups = [line for line in lines if "<static" in line]
    number = int((scene.paint != 0).sum())
    assert len(groups) == 2 * number
    assert sum("animation:gi 1s linear 0s backwards" in line for line in groups) == number
    goes = "go 0s linear 1s forwards" if opacity > 0.8 else "go 1s linear 0s forwards"
    assert sum(goes in line for line in groups) == number


def test_an_outline_that_loses_points_keeps_its_commands() -> None:
    row = int(np.flatnonzero(SCENE.basis == Basis.SPLINE)[0])
    keep = np.arange(len(SCENE.points)) != SCENE.first[row] + 1
    lines, _ = made(SCENE, SCENE.without_points(keep))
    assert len(lines) == len(SCENE)
    first, second = places(lines[row])
    assert commands(first) == commands(second) and first != second


def later(scene: Scene, keep: list[int], new: Scene) -> Scene:
    """Return the scene a densification and some steps later."""
    moved = scene.take(np.array(keep))
    points = moved.points + np.random.default_rng(0).normal(0, 0.3, moved.points.shape).astype(np.float32)
    return replace(moved, points=points).append(new)


def test_shapes_are_tracked_through_densification() -> None:
    """Moved shapes keep their numbers, new ones get new numbers, and one order fits all scenes."""
    first, other = mixed_scene(seed=1), mixed_scene(seed=2)
    count = len(first)
    second = later(first, [i for i in range(count) if i != 2], other.take(np.array([0])))
    third = later(second, list(range(1, count)), other.take(np.array([3])))
    numbers, order = track_shapes([first, second, third])
    assert numbers[1].tolist() == [0, 1, *range(3, count), count]
    assert numbers[2].tolist() == [1, *range(3, count), count, count + 1]
    assert sorted(order) == list(range(count + 2))
    assert all((np.diff([order.index(n) for n in row]) > 0).all() for row in numbers)


def test_a_shape_that_changes_depth_is_another_one() -> None:
    """Otherwise no order would fit both scenes."""
    scene = mixed_scene()
    numbers, order = track_shapes([scene, scene.take(np.roll(np.arange(len(scene)), 1))])
    assert numbers[1].tolist() == [len(scene), *range(len(scene) - 1)]
    assert order[0] == len(scene)
