"""Shapes as moving elements."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import forms_scene, mixed_scene, with_gradients
from warpsplat.motion.moving import kept_points, moving_elements
from warpsplat.scene import Basis, Scene

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


def test_a_new_shape_waits_at_its_first_position() -> None:
    lines, _ = made(LESS, LESS, SCENE, MOVED)
    late = next(line for line in lines if "animation:i 1s linear 1s backwards" in line)
    first, second, third = places(late, 1)
    assert first == second != third and f'd="{third}"' in late


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


def test_gradients_stay_until_they_change() -> None:
    scene = with_gradients(SCENE)
    groups = [line for line in made(scene, scene, scene)[0] if "<static" in line]
    assert len(groups) == int((scene.paint != 0).sum())
    assert not any("animation" in line for line in groups)


def test_colours_change_when_they_differ_enough() -> None:
    scene = replace(SCENE, colors=np.full((len(SCENE), 3), 0.5, np.float32))
    other = scene.colors.copy()
    other[0] += 0.004
    other[1] = 0.6
    lines, rules = made(scene, scene, replace(scene, colors=other))
    assert rules.count("@keyframes p") == 1
    assert re.search(r"@keyframes p1\{0%\{[^}]*:#808080[^}]*\}100%\{[^}]*:#999[;}]", rules)
    assert "animation:p1 1s linear 1s backwards" in lines[1] and "#999" in lines[1]


def test_an_outline_that_loses_points_keeps_its_commands() -> None:
    row = int(np.flatnonzero(SCENE.basis == Basis.SPLINE)[0])
    keep = np.arange(len(SCENE.points)) != SCENE.first[row] + 1
    lines, _ = made(SCENE, SCENE.without_points(keep))
    assert len(lines) == len(SCENE)
    first, second = places(lines[row])
    assert commands(first) == commands(second) and first != second


def test_kept_points() -> None:
    before = np.array([[0, 0], [5, 0], [5, 5], [0, 5], [0, 2]], np.float32)
    assert kept_points(before, before[[0, 2, 4]] + np.float32(0.4)).tolist() == [0, 2, 4]
    assert kept_points(before, before[[1, 2, 3, 4]]).tolist() == [1, 2, 3, 4]
