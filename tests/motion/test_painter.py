"""The painter draws scenes as viewers show their files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.scenes import mixed_scene, with_gradients
from warpsplat.errors import CapacityError
from warpsplat.fit.export import export
from warpsplat.fit.settings import Settings
from warpsplat.metrics import psnr
from warpsplat.motion.painter import Painter
from warpsplat.rendering import renderer as rendering
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Scene
from warpsplat.svg.viewer import premultiplied, render_svg
from warpsplat.svg.write import GRIDS

SIZE = (96, 72)


def flat() -> Scene:
    return mixed_scene(48, 36)


def ramped() -> Scene:
    return with_gradients(flat())


def transparent() -> Scene:
    return replace(flat(), canvas=replace(flat().canvas, background=None))


def painted(scene: Scene, settings: Settings) -> Image.Image:
    return Painter(Backend.on("cpu", 1), settings, SIZE).paint(scene, 2.0)


@pytest.mark.parametrize("renderer", ["exact", "splat", "gaussian"])
@pytest.mark.parametrize("make", [flat, ramped, transparent])
def test_pictures_look_as_a_viewer_shows_the_file(renderer: str, make: Callable[[], Scene]) -> None:
    scene, settings = make(), Settings(renderer=renderer)
    made, seen = painted(scene, settings), render_svg(export(scene, settings, GRIDS[-1]), zoom=2.0)
    assert made.size == SIZE
    assert psnr(premultiplied(made), premultiplied(seen)) > 36, "39.9 to 42.8 dB over five scenes"


def test_a_viewer_draws_what_the_renderer_cannot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Too many shapes, and none."""

    def refuses(*_: object) -> None:
        raise CapacityError("too many")

    scene, settings = flat(), Settings()
    empty = scene.take(np.arange(0))
    monkeypatch.setattr(rendering.Renderer, "grow", refuses)
    for one in (scene, empty):
        seen = render_svg(export(one, settings, GRIDS[-1]), zoom=2.0)
        assert psnr(premultiplied(painted(one, settings)), premultiplied(seen)) > 45
