"""Equal outlines written once show the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.drawing.drawings import BLUE, GOLD, RED, ROUND, WHITE, Outline, disc, drawing, star
from warpsplat.scene import Canvas, Scene
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import render_own
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


def test_what_is_shorter_stays() -> None:
    """Outlines that occur once, and discs, which an element describes."""
    scene = drawing(Canvas(80, 56, WHITE), (RED, [star(20, 20, 9, 5)]), (BLUE, [disc(60, 30, 5)])).scene
    assert "<use" not in write_svg(rounded(scene, 10), per_pixel=10, symbols=True)
