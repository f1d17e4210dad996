"""Few colours: how shapes choose them, and the file."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.fit.pictures import picture, step_for
from tests.runs import vectorize
from warpsplat.errors import UsageError
from warpsplat.fit.options import parse_palette
from warpsplat.fit.palette import best_colors, main_colors
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.run.options import settings_from
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Scene

COLOR = re.compile(r'(?:fill|stroke)="(#[0-9a-f]{3,6})"')


def squares(colors: list[list[float]]) -> Scene:
    square = np.array([[[8, 8], [24, 8], [24, 24], [8, 24]]], np.float32)
    return Scene.uniform(
        Kind.FILL,
        Canvas(64, 48, np.zeros(3, np.float32)),
        square + np.arange(len(colors))[:, None, None],
        Basis.SPLINE,
        colors=np.array(colors, np.float32),
        opacities=np.ones(len(colors), np.float32),
    )


@pytest.mark.parametrize("kind", Kind)
@pytest.mark.parametrize(
    "given",
    [{"colors": 4}, {"palette": "#000,#fc2,#284,#48c"}, {"opaque": True}],
    ids=["4", "palette", "any"],
)
def test_files_are_opaque_and_have_no_other_colours(
    device: str, kind: Kind, given: dict[str, object]
) -> None:
    settings = make_settings(kind=kind, curves=20, iterations=60, **given)
    result = vectorize(picture(), settings, Backend.on(device))
    found = set(COLOR.findall(result.svg))
    assert found if "opaque" in given else 0 < len(found) <= 4
    assert "palette" not in given or found <= {"#000", "#fc2", "#284", "#48c"}
    assert "opacity" not in result.svg
    assert (result.scene.opacities > 0.99).all()
    assert result.score
    assert result.score.psnr > 12


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_the_error_is_least_at_the_best_colour(opacity: float, *, transparent: bool) -> None:
    """For a single shape: in each channel it grows as much on one side as on the other."""
    scene, target = squares([[0.2, 0.9, 0.4]]), picture()
    scene = replace(scene, opacities=np.full(1, opacity, np.float32))
    if transparent:
        scene = replace(scene, canvas=replace(scene.canvas, background=None))
        target = np.concatenate([0.7 * target, np.full_like(target[..., :1], 0.7)], axis=2)
    step = step_for(scene, target)
    best = best_colors(step, scene)

    def error(colors: FloatArray) -> float:
        step.state.parameters.assign(replace(scene, colors=colors))
        step.render()
        return step.objective.value()

    least = error(best)
    for channel in range(3):
        off = np.zeros((1, 3), np.float32)
        off[0, channel] = 0.05
        around = error(best + off), error(best - off)
        assert min(around) > least
        assert around[0] == pytest.approx(around[1], rel=1e-3)


def test_hidden_shapes_keep_their_colour() -> None:
    scene = squares([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    points = np.concatenate([scene.points[:4], scene.points[:4] * [2, 2] - [16, 16]])
    scene = replace(scene, points=np.asarray(points, np.float32))
    assert (best_colors(step_for(scene, picture()), scene)[0] == scene.colors[0]).all()


def test_main_colours_are_the_pictures_own() -> None:
    own = np.array([[255, 0, 0], [0, 128, 255], [20, 20, 20]], np.float32) / 255
    rng = np.random.default_rng(0)
    colors = own[rng.integers(0, 3, 3000)]
    blurred = np.clip(colors[:200] + rng.normal(0, 0.05, (200, 3)), 0, 1).astype(np.float32)
    everything = np.concatenate([colors, blurred])
    found = main_colors(everything, np.ones(len(everything), np.int64), 3)
    assert {tuple(color) for color in found} == {tuple(color) for color in own}
    assert len(main_colors(own, np.ones(3, np.int64), 8)) == 3


def test_palettes_as_texts(tmp_path: Path) -> None:
    assert parse_palette("#F00, lime\n#f00, Red") == ("#ff0000", "#00ff00")
    for bad in ("rad", "#12", "", "#ggg"):
        with pytest.raises(UsageError, match="palette must be colours"):
            parse_palette(bad)
    file = tmp_path / "colors.txt"
    file.write_text("#fff\n#010203\n")
    assert settings_from({"palette": str(file)}).palette == ("#ffffff", "#010203")
    assert settings_from({"palette": "black,white"}).palette == ("#000000", "#ffffff")
    with pytest.raises(UsageError, match="No such file"):
        settings_from({"palette": str(tmp_path / "none")})
