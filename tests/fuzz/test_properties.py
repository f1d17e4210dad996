"""Properties that must hold for any input, on inputs from hypothesis."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from tests.fuzz.corpus import saved
from tests.fuzz.drawings import drawings
from tests.fuzz.vocabulary import HEIGHT, NUMBERS, WIDTH
from warpsplat.errors import ImageError, OutputError, UsageError, explain
from warpsplat.extensions import renderer_names
from warpsplat.files.output import check_output, write_atomically
from warpsplat.files.sources import image_of
from warpsplat.fit.options import parse_bytes, parse_duration
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.metrics import psnr
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_own
from warpsplat.svg.write import write_svg

pytestmark = pytest.mark.slow


def examples(count: int) -> Callable[[Any], Any]:
    """Use the same ``count`` examples on every run, and store none."""
    return settings(
        max_examples=count,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    )


def one_line(error: BaseException) -> str:
    """Return the message of an error, which must be one line."""
    message, _ = explain(error)
    assert message.isprintable()
    return message


numbers = st.sampled_from(NUMBERS) | st.integers().map(str) | st.floats().map(repr)
blanks = st.sampled_from(["", " ", "\t"])


@examples(150)
@given(st.text(max_size=20) | st.tuples(numbers, st.text("smhinKMGTBekib ", max_size=4)).map("".join))
def test_durations_and_sizes_are_numbers_or_refused(text: str) -> None:
    for parse in (parse_duration, parse_bytes):
        try:
            value = parse(text)
        except UsageError as error:
            one_line(error)
        else:
            assert math.isfinite(value)
            assert value >= 0


SECONDS = {"ms": 0.001, "s": 1, "": 1, "m": 60, "h": 3600}
BYTES = {"": 1, "B": 1, "kB": 1e3, "KiB": 2**10, "MB": 1e6, "MiB": 2**20, "GB": 1e9}


@examples(200)
@given(st.integers(0, 10**6), blanks, st.sampled_from([*SECONDS]), st.sampled_from([*BYTES]))
def test_units_of_durations_and_sizes(number: int, blank: str, duration: str, size: str) -> None:
    assert parse_duration(f"{number}{blank}{duration}") == pytest.approx(number * SECONDS[duration])
    assert parse_bytes(f"{number}{blank}{size}") == number * BYTES[size]


def assert_named(error: ImageError) -> None:
    assert one_line(error).startswith("made up: ")


def load(pixels: np.ndarray, form: str) -> np.ndarray:
    return image_of(saved(Image.fromarray(pixels), form), "made up", paper=1.0)


shapes = st.tuples(st.integers(2, 20), st.integers(2, 20))
transparent = shapes.flatmap(lambda s: arrays.arrays(np.uint8, (*s, 4)))


@examples(100)
@given(
    transparent | shapes.flatmap(lambda s: arrays.arrays(np.uint16, (*s, 1))),
    st.sampled_from(["PNG", "TIFF"]),
)
def test_pixels_come_back_on_white(pixels: np.ndarray, form: str) -> None:
    levels = pixels / np.iinfo(pixels.dtype).max
    alpha = levels[..., 3:] if levels.shape[2] == 4 else 1.0
    loaded = load(pixels.squeeze(axis=2) if pixels.shape[2] == 1 else pixels, form)
    np.testing.assert_allclose(
        loaded, np.broadcast_to(levels[..., :3] * alpha + 1 - alpha, loaded.shape), atol=1e-6
    )


@examples(60)
@given(shapes.flatmap(lambda s: arrays.arrays(np.float32, s)))
def test_floats_are_pixels_or_refused(pixels: np.ndarray) -> None:
    """Floats may be NaN, infinite or out of range."""
    try:
        loaded = load(pixels, "TIFF")
    except ImageError as error:
        assert_named(error)
        return
    assert loaded.dtype == np.float32
    assert np.isfinite(loaded).all()
    assert loaded.min() >= 0 and loaded.max() <= 1


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("batch")
    (path / "a.png").touch()
    return path


options = st.fixed_dictionaries(
    {},
    optional={
        "curves": st.integers(1, 100_000),
        "iterations": st.integers(1, 1_000_000),
        "seed": st.integers(0, 2**32 - 1),
        "precision": st.integers(0, 6),
        "renderer": st.sampled_from([name for name in renderer_names() if name != "gaussian"]),
        "quality": st.sampled_from(["draft", "balanced", "high"]),
        "target-psnr": st.floats(1, 99, allow_nan=False).map(lambda x: round(x, 3)),
        "time-budget": st.integers(1, 500).map("{}s".format),
        "max-bytes": st.integers(1, 500).map("{}KB".format),
    },
)


@pytest.mark.needs("batch")
@examples(50)
@given(options, options)
def test_settings_of_a_batch_are_those_of_the_flags(
    folder: Path, defaults: dict[str, Any], own: dict[str, Any]
) -> None:
    from tests.batch.helpers import load_jobs

    path = folder / "jobs.yaml"
    path.write_text(yaml.safe_dump({"defaults": defaults, "jobs": [{"images": "a.png", **own}]}))
    flags = {key.replace("-", "_"): value for key, value in {**defaults, **own}.items()}
    expected: Settings = make_settings(flags.pop("quality", "balanced"), **flags)
    assert load_jobs(path)[0].settings == expected


@examples(60)
@given(st.text(st.characters(codec="utf-8") | st.sampled_from("/.\0\n\udc80-~ "), min_size=1, max_size=8))
def test_a_name_can_be_written_or_is_refused(name: str) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "folder"
        folder.mkdir()
        path = folder / (name.lstrip("/") + ".svg")
        try:
            check_output(path)
            write_atomically(path, b"<svg/>")
        except (UsageError, OutputError) as error:
            one_line(error)
            assert not os.listdir(folder)
        else:
            assert path.read_bytes() == b"<svg/>"


@examples(120)
@given(drawings)
def test_a_drawing_is_held_as_it_looks_or_refused(text: str) -> None:
    """The scene that ``refine`` starts from looks as the SVG."""
    try:
        scene, background = load_scene(text, WIDTH, HEIGHT, "made up")
    except ImageError as error:
        assert_named(error)
        return
    svg = write_svg(scene, background=background)
    own, large = f'width="{WIDTH}" height="{HEIGHT}"', f'width="{8 * WIDTH}" height="{8 * HEIGHT}"'
    held, shown = (on_white(render_own(t.replace(own, large, 1))) for t in (svg, text))
    assert held.shape == (8 * HEIGHT, 8 * WIDTH, 3)
    assert psnr(held, shown) > FAITHFUL, text


FAITHFUL = 30.0
"""Least PSNR of a scene read from an SVG [dB]; a lost dash costs more than twenty."""
