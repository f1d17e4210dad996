"""Shapes as moving elements."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import mixed_scene, with_gradients
from warpsplat.motion.moving import kept_points, moving_elements
from warpsplat.scene import Basis, Scene

UNITS = 400.0


def made(*scenes: Scene) -> tuple[list[str], str]:
    """Return lines of elements, with keyframes a second apart, and the rules."""
    text, rules = moving_elements(
        scenes, range(len(scenes)), 1.0, UNITS, lambda scene: f"<static{len(scene)}/>"
    )
    return text.splitlines(), rules


def places(line: str) -> list[str]:
    """Return the path data of a moving path by keyframe."""
    found = re.search(r'<animate attributeName="d" begin="0s" [^>]*values="([^"]*)"', line)
    assert found
    return found[1].split(";")


def commands(data: str) -> list[tuple[str, int]]:
    return [
        (letter, len(re.findall(r"-?\d+", row))) for letter, row in re.findall("([a-zA-Z])([^a-zA-Z]*)", data)
    ]


def test_paths_move_with_equal_commands() -> None:
    scene = mixed_scene()
    lines, _ = made(scene, replace(scene, points=scene.points + np.float32(1)), scene)
    assert len(lines) == len(scene)
    for line in lines:
        first, second, third = places(line)
        assert first == third != second and f'd="{third}"' in line
        assert commands(first) == commands(second)
        x, y, u, v = (int(n) for part in (first, second) for n in re.findall(r"-?\d+", part)[:2])
        assert abs(u - x - 10) <= 2 and abs(v - y - 10) <= 2, "400 units on a canvas of 40"


def test_shapes_fade_in_and_out() -> None:
    scene = mixed_scene()
    less = scene.take(np.arange(1, len(scene)))
    lines, _ = made(less, scene, scene, less)
    fading = [line for line in lines if "animation:" in line]
    assert len(fading) == 1 and fading[0] is not lines[-1]
    assert 'animation:i 1s linear 0s backwards,o 1s linear 2s forwards"' in fading[0]


def test_a_new_shape_waits_at_its_first_position() -> None:
    scene = mixed_scene()
    less, moved = scene.take(np.arange(1, len(scene))), replace(scene, points=scene.points + np.float32(1))
    lines, _ = made(less, less, scene, moved)
    late = next(line for line in lines if "animation:i 1s linear 1s backwards" in line)
    found = re.search(r'begin="1s" dur="2s" values="([^"]*)"', late)
    assert found
    first, second, third = found[1].split(";")
    assert first == second != third and f'd="{third}"' in late


@pytest.mark.parametrize("opacity", [1.0, 0.9, 0.6])
def test_an_opaque_element_stays_until_its_successor_is_there(opacity: float) -> None:
    scene = with_gradients(mixed_scene())
    scene = replace(
        scene,
        opacities=np.full_like(scene.opacities, opacity),
        stop_opacities=np.ones_like(scene.stop_opacities),
    )
    number = int((scene.paint != 0).sum())
    count = iter(range(9 * number))
    text, _ = moving_elements([scene, scene], range(2), 1.0, UNITS, lambda _: f"<static{next(count)}/>")
    groups = [line for line in text.splitlines() if "<static" in line]
    assert len(groups) == 2 * number
    assert sum("animation:gi 1s linear 0s backwards" in line for line in groups) == number
    goes = "go 0s linear 1s forwards" if opacity > 0.8 else "go 1s linear 0s forwards"
    assert sum(goes in line for line in groups) == number


def test_colours_change_when_they_differ_enough() -> None:
    scene = replace(mixed_scene(), colors=np.full((len(mixed_scene()), 3), 0.5, np.float32))
    other = scene.colors.copy()
    other[0] += 0.004
    other[1] = 0.6
    lines, rules = made(scene, scene, replace(scene, colors=other))
    assert rules.count("@keyframes p") == 1
    assert re.search(r"@keyframes p1\{0%\{[^}]*:#808080[^}]*\}100%\{[^}]*:#999[;}]", rules)
    assert "animation:p1 1s linear 1s backwards" in lines[1] and "#999" in lines[1]


def test_an_outline_that_loses_points_keeps_its_commands() -> None:
    scene = mixed_scene()
    row = int(np.flatnonzero(scene.basis == Basis.SPLINE)[0])
    keep = np.ones(len(scene.points), np.bool_)
    keep[scene.first[row] + 1] = False
    lines, _ = made(scene, scene.without_points(keep))
    assert len(lines) == len(scene)
    first, second = places(lines[row])
    assert commands(first) == commands(second) and first != second


def test_kept_points() -> None:
    before = np.array([[0, 0], [5, 0], [5, 5], [0, 5], [0, 2]], np.float32)
    assert kept_points(before, before[[0, 2, 4]] + np.float32(0.4)).tolist() == [0, 2, 4]
    assert kept_points(before, before[[1, 2, 3, 4]]).tolist() == [1, 2, 3, 4]


def test_gradients_stay_until_they_change() -> None:
    scene = with_gradients(mixed_scene())
    lines, _ = made(scene, scene, scene)
    assert sum("<static1/>" in line for line in lines) == int((scene.paint != 0).sum())
    assert not any("<static" in line and "animation" in line for line in lines)
