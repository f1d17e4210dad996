"""Results and scenes behave as Python's own objects do: in notebooks, comparisons, sets and ``help``."""

from __future__ import annotations

import base64
import dataclasses
import inspect
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.scenes import contours_scene, mixed_scene, picture_scene, with_gradients
from warpsplat.errors import UsageError
from warpsplat.run.result import LevelScore
from warpsplat.scene import Canvas, KeptPicture, Kind, Rule, Scene
from warpsplat.svg.viewer import render_svg

PIXELS = np.random.default_rng(0).uniform(0, 1, (24, 32, 3))


def pictured() -> Scene:
    canvas = Canvas(20, 10, None)
    return picture_scene(canvas, KeptPicture("<g/>", (20, 10), (2, 3), np.full((4, 5, 4), 0.5, np.float32)))


@pytest.fixture(scope="module")
def results() -> list[warpsplat.Result]:
    """Two runs with one seed, and one with another number of shapes."""
    return [warpsplat.vectorize(PIXELS, n, subject="photo", iterations=6, device="cpu") for n in (4, 4, 5)]


def test_results_of_equal_runs_are_equal(results: list[warpsplat.Result]) -> None:
    one, same, other = results
    assert one == same != other
    assert len({one, same, other}) == 2
    anything: object = "another thing"
    assert one != anything
    assert replace(one, render_psnr=math.nan) == replace(same, render_psnr=math.nan)


@pytest.mark.parametrize(
    "scene",
    [
        mixed_scene(seed=1),
        with_gradients(mixed_scene(seed=2)),
        contours_scene(Kind.FILL, Rule.EVENODD),
        pictured(),
    ],
)
def test_scenes_are_equal_if_their_values_are(scene: Scene) -> None:
    arrays = {name: value for name, value in vars(scene).items() if isinstance(value, np.ndarray)}
    copy = replace(scene, **{name: value.copy() for name, value in arrays.items()})
    assert copy == scene and hash(copy) == hash(scene)
    for name, value in arrays.items():
        if value.size and value.dtype == np.float32:
            assert replace(scene, **{name: value + 1}) != scene, name
    assert scene.take(np.arange(len(scene) - 1)) != scene
    for changed in ({"background": np.ones(3, np.float32)}, {"background": None, "crisp": True}):
        assert replace(scene, canvas=replace(scene.canvas, **changed)) != scene
    assert scene != 3


def test_a_repr_is_a_line(results: list[warpsplat.Result]) -> None:
    result = results[0]
    figures = rf"4 shapes, {result.score.psnr:.2f} dB, {len(result.svg)} bytes, photo, \d+\.\d s"  # type: ignore[union-attr]
    assert re.fullmatch(rf"Result\({figures}\)", repr(result))
    assert repr(replace(result, score=None, stopped=True)).endswith("s, stopped)")
    counts = f"4 shapes, 0 of them strokes, {len(result.scene.points)} points"
    assert repr(result.scene) == f"Scene(32x24 px, {counts})"


def test_notebooks_show_the_file(results: list[warpsplat.Result]) -> None:
    result = results[0]
    assert result._repr_svg_() == result.svg
    shown = result._repr_html_()
    assert repr(result)[len("Result(") : -1] in shown
    source = re.search(r'src="data:image/svg\+xml;base64,([^"]*)"', shown)
    assert source
    assert render_svg(base64.b64decode(source[1]).decode()).size == (32, 24)


PUBLIC = "Result Score Progress Snapshot Expected Suggestion Scene Canvas CustomLoss"
DESCRIBED = [LevelScore, KeptPicture, *(getattr(warpsplat, name) for name in PUBLIC.split())]


@pytest.mark.parametrize("cls", DESCRIBED)
def test_help_describes_every_field(cls: Any) -> None:
    text = inspect.getdoc(cls) or ""
    for field in dataclasses.fields(cls):
        assert re.search(rf"^    {field.name}: \S", text, re.MULTILINE), field.name


def test_a_result_spares_files_of_others_if_it_is_told_to(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    result = warpsplat.vectorize(np.zeros((8, 8, 3), np.uint8), subject="pixel")
    path.write_text("<svg/>")
    with pytest.raises(UsageError, match="was not written by warpsplat"):
        result.save(path, overwrite=False)
    assert path.read_text() == "<svg/>"
    result.save(path)
    result.save(path, overwrite=False)
    assert path.read_text() == result.svg


def test_a_result_is_no_file_of_another_kind(tmp_path: Path) -> None:
    """An SVG's text in a .jpg could not be opened."""
    result = warpsplat.vectorize(np.zeros((8, 8, 3), np.uint8), subject="pixel")
    with pytest.raises(UsageError, match=r"a\.jpg: a result's name ends with \.svg, "):
        result.save(tmp_path / "a.jpg")
    with pytest.raises(UsageError, match="curves must be several numbers of shapes, not 5"):
        warpsplat.vectorize_several(np.zeros((8, 8, 3), np.uint8), 5)
    assert not [*tmp_path.iterdir()]
