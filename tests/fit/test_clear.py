from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.scenes import disc, random_scene
from warpsplat.fit import clear
from warpsplat.fit.clear import clear_empty
from warpsplat.fit.export import export, show
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Renderer
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


def test_a_clear_scene_stays_as_it_is(device: str) -> None:
    scene = random_scene(Kind.FILL, 5, basis=Basis.SPLINE)
    scene = replace(scene, canvas=Canvas(40, 36, None))
    cleared = clear_empty(scene, shown(scene), SETTINGS, Run(Backend.on(device)), 10.0)
    np.testing.assert_array_equal(cleared.points, rounded(scene, 10.0).points)


def test_the_rounds_end_with_the_run(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """When it is stopped, and when its time is up; all of them share one renderer."""
    scene, target = spilling()
    pictures, renderers = list[Scene](), list[Renderer]()

    def counted_show(text: str, scene: Scene) -> Image.Image:
        pictures.append(scene)
        return show(text, scene)

    def counted_renderer(*arguments: Any) -> Renderer:
        renderers.append(Renderer(*arguments))
        return renderers[-1]

    monkeypatch.setattr(clear, "show", counted_show)
    monkeypatch.setattr(clear, "Renderer", counted_renderer)
    backend = Backend.on(device)
    clear_empty(scene, target, SETTINGS, Run(backend, stop=lambda: len(pictures) == 3), 10.0)
    assert len(pictures) == 3
    assert len(renderers) == 1
    late = clear_empty(scene, target, SETTINGS, Run(backend, deadline=-math.inf), 10.0)
    assert late is scene
    assert len(pictures) == 3
