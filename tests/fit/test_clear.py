from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tests.scenes import disc, random_scene
from warpsplat.fit.clear import clear_empty
from warpsplat.fit.export import export
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Basis, Canvas, Kind, Scene
from warpsplat.svg.viewer import premultiplied, render_own
from warpsplat.svg.write import rounded

SETTINGS = make_settings()


def shown(scene: Scene) -> np.ndarray:
    return premultiplied(render_own(export(scene, SETTINGS, 10.0))) / 255


def spilling() -> tuple[Scene, np.ndarray]:
    """Return a disc, and the image of a smaller one."""
    scene = replace(disc(12, 40, 20), canvas=Canvas(40, 40, None))
    return scene, shown(replace(scene, points=20 + (scene.points - 20) * np.float32(11.3 / 12)))


def test_outlines_are_drawn_back_no_further_than_needed(device: str) -> None:
    scene, target = spilling()
    empty = target[..., 3] == 0
    assert shown(scene)[empty].any()
    cleared = clear_empty(scene, target, SETTINGS, Run(Backend.on(device)), 10.0)
    assert not shown(cleared)[empty].any()
    assert np.abs(cleared.points - scene.points).max() < 1.5
    late = Run(Backend.on(device), deadline=-math.inf)
    assert clear_empty(scene, target, SETTINGS, late, 10.0) is scene


def test_a_clear_scene_stays_as_it_is(device: str) -> None:
    scene = random_scene(Kind.FILL, 5, basis=Basis.SPLINE)
    scene = replace(scene, canvas=Canvas(40, 36, None))
    cleared = clear_empty(scene, shown(scene), SETTINGS, Run(Backend.on(device)), 10.0)
    np.testing.assert_array_equal(cleared.points, rounded(scene, 10.0).points)
