"""Few colours: what shapes have, how they choose, what the file has."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.fit.pictures import picture
from warpsplat.errors import UsageError
from warpsplat.fit.palette import Palette, main_colors
from warpsplat.fit.settings import make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.texts import parse_palette
from warpsplat.jobs.options import settings_from
from warpsplat.jobs.vectorize import vectorize
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Basis, Canvas, Kind, Scene

COLOR = re.compile(r'(?:fill|stroke)="(#[0-9a-f]{3,6})"')


def squares(colors: list[list[float]]) -> Scene:
    points = (
        np.array([[[8, 8], [24, 8], [24, 24], [8, 24]]], np.float32) + np.arange(len(colors))[:, None, None]
    )

    return Scene.uniform(
        Kind.FILL,
        Canvas(64, 48, np.zeros(3, np.float32)),
        points,
        Basis.SPLINE,
        colors=np.array(colors, np.float32),
        opacities=np.ones(len(colors), np.float32),
    )


@pytest.mark.parametrize("kind", Kind)
@pytest.mark.parametrize("given", [{"colors": 4}, {"palette": "#000,#fc2,#284,#48c"}])
def test_a_file_has_no_other_colours(device: str, kind: Kind, given: dict[str, object]) -> None:
    settings = make_settings(kind=kind, curves=20, iterations=60, **given)
    result = vectorize(picture(), settings, Backend.on(device))
    found = set(COLOR.findall(result.svg))
    assert 1 < len(found) <= 4
    if "palette" in given:
        assert found <= {"#000", "#fc2", "#284", "#48c"}
    assert "opacity" not in result.svg
    assert result.score
    assert result.score.psnr > 12


def test_small_steps_towards_another_colour_add_up() -> None:
    """Each alone would be taken back."""
    state = FitState.start(squares([[0.1, 0.1, 0.1]]), Backend.on("cpu"), np.random.default_rng(0))
    palette = Palette(np.array([[0, 0, 0], [1, 1, 1]], np.float32))
    shown = []
    for _ in range(30):
        palette.choose(state)
        scene = state.scene()
        shown.append(float(scene.colors[0, 0]))
        state.parameters.groups["colors"].value.assign(scene.colors + np.float32(0.02))
    assert shown[0] == 0
    assert shown[-1] == 1
    assert shown == sorted(shown)


def test_colours_that_are_not_given_follow_the_shapes() -> None:
    start = np.full((1, 3), 0.2, np.float32)
    for given in (True, False):
        state = FitState.start(squares([[0.5, 0.5, 0.5]]), Backend.on("cpu"), np.random.default_rng(0))
        palette = Palette(start.copy(), given=given)
        palette.choose(state)
        assert (palette.colors > start).all() == (not given)


def test_main_colours_are_the_pictures_own() -> None:
    own = np.array([[255, 0, 0], [0, 128, 255], [20, 20, 20]], np.float32) / 255
    rng = np.random.default_rng(0)
    colors = own[rng.integers(0, 3, 3000)]
    blurred = np.clip(colors[:200] + rng.normal(0, 0.05, (200, 3)), 0, 1).astype(np.float32)
    everything = np.concatenate([colors, blurred])
    found = main_colors(everything, np.ones(len(everything), np.int64), 3)
    assert {tuple(color) for color in found} == {tuple(color) for color in own}
    assert len(main_colors(own, np.ones(3, np.int64), 8)) == 3


def test_opaque_shapes_are_opaque(device: str) -> None:
    result = vectorize(picture(), make_settings(curves=16, iterations=60, opaque=True), Backend.on(device))
    assert "opacity" not in result.svg
    assert (result.scene.opacities > 0.99).all()


def test_palettes_as_texts(tmp_path: Path) -> None:
    assert parse_palette("#F00, #00ff00\n#f00") == ("#ff0000", "#00ff00")
    for bad in ("red", "#12", "", "#ggg"):
        with pytest.raises(UsageError, match="palette must be colours"):
            parse_palette(bad)
    file = tmp_path / "colors.txt"
    file.write_text("#fff\n#010203\n")
    assert settings_from({"palette": str(file)}).palette == ("#ffffff", "#010203")
    with pytest.raises(UsageError, match="No such file"):
        settings_from({"palette": str(tmp_path / "none")})
    with pytest.raises(UsageError, match="colors"):
        make_settings(colors=0)
