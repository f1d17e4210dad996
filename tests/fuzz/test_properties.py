"""Properties that must hold for any input, on inputs from hypothesis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.vocabulary import (
    CLAIMS_OF_FILLS,
    CLAIMS_OF_STROKES,
    GROUPS,
    HEAD,
    HEIGHT,
    PAINTS,
    WIDTH,
)
from warpsplat.errors import ImageError, explain
from warpsplat.extensions import renderer_names
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


numbers = st.integers(-4, 36).map(str)
sizes = st.integers(1, 20).map(str)
flags = st.sampled_from("01")
points = st.tuples(numbers, numbers).map(" ".join)


def _command(letter: str, *arguments: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.tuples(*arguments).map(lambda a: letter + " ".join(a))


curves = st.one_of(
    _command("L", points),
    _command("C", points, points, points),
    _command("s", points, points),
    _command("Q", points, points),
    _command("T", points),
    _command("A", sizes, sizes, numbers, flags, flags, points),
    _command("h", numbers),
    _command("z"),
)


def _ring(controls: list[tuple[int, int]], letters: str, ending: str) -> str:
    """Return a closed spline as a path: one quadratic and smooth ones, back at its start."""
    joints = [(a[0] + b[0], a[1] + b[1]) for a, b in zip(controls, controls[1:] + controls[:1], strict=True)]
    x, y = joints[-1]
    data = f"M{x} {y}"
    for i, (u, v) in enumerate(joints):
        ends = [(u, v)] if i else [(2 * controls[0][0], 2 * controls[0][1]), (u, v)]
        if letters.islower():
            ends = [(a - x, b - y) for a, b in ends]
        data += letters[min(i, 1)] + " ".join(f"{a} {b}" for a, b in ends)
        x, y = u, v
    return data + ending


freely = st.tuples(points, st.lists(curves, min_size=1, max_size=5)).map(lambda p: f"M{p[0]}" + "".join(p[1]))
smoothly = st.tuples(points, points, st.lists(points, min_size=1, max_size=5)).map(
    lambda p: f"M{p[0]}Q{p[1]} {p[2][0]}" + "".join("T" + q for q in p[2][1:])
)
corners = st.tuples(st.integers(-1, 17), st.integers(-1, 13))
rings = st.builds(
    _ring,
    st.lists(corners, min_size=2, max_size=7),
    st.sampled_from(("QT", "qt")),
    st.sampled_from(("", "z")),
)
outlines = st.one_of(freely, smoothly, rings)
elements = st.one_of(
    st.lists(outlines, min_size=1, max_size=2).map(lambda d: f'<path d="{"".join(d)}"'),
    st.tuples(numbers, numbers, sizes, sizes, sizes).map(
        lambda r: f'<rect x="{r[0]}" y="{r[1]}" width="{r[2]}" height="{r[3]}" rx="{r[4]}"'
    ),
    st.tuples(numbers, numbers, sizes).map(lambda c: f'<circle cx="{c[0]}" cy="{c[1]}" r="{c[2]}"'),
    st.lists(points, min_size=3, max_size=5).map(lambda p: f'<polygon points="{" ".join(p)}"'),
)
paints = st.sampled_from(PAINTS)
filled = st.tuples(elements, paints, st.sampled_from(CLAIMS_OF_FILLS)).map(
    lambda e: f'{e[0]} fill="{e[1]}" {e[2]}/>'
)
stroked = st.tuples(elements, paints, st.sampled_from(CLAIMS_OF_STROKES)).map(
    lambda e: f'{e[0]} fill="none" stroke="{e[1]}" {e[2]}/>'
)


def _drawing(group: str, shapes: list[str], per_pixel: int) -> str:
    """``per_pixel``: units of the view box to a pixel."""
    name = group.strip("<>").split()[0]
    drawn = f"{group}{''.join(shapes)}</{name}>"
    if per_pixel == 1:
        return f"{HEAD}{drawn}</svg>"
    box = f'viewBox="0 0 {per_pixel * WIDTH} {per_pixel * HEIGHT}"'
    head = HEAD.replace(f'viewBox="0 0 {WIDTH} {HEIGHT}"', box)
    return f'{head}<g transform="scale({per_pixel})">{drawn}</g></svg>'


drawings = st.builds(
    _drawing,
    st.sampled_from(GROUPS),
    st.lists(filled, min_size=1, max_size=4) | st.lists(stroked, min_size=1, max_size=4),
    st.sampled_from((1, 1, 3, 100)),
)
"""A few shapes in one group."""


SECONDS = {"ms": 0.001, "s": 1, "": 1, "m": 60, "h": 3600}
BYTES = {"": 1, "B": 1, "kB": 1e3, "KiB": 2**10, "MB": 1e6, "MiB": 2**20, "GB": 1e9}


@pytest.mark.parametrize("blank", ["", " ", "\t"])
@pytest.mark.parametrize("number", [0, 7, 1500])
def test_units_of_durations_and_sizes(number: int, blank: str) -> None:
    for duration, seconds in SECONDS.items():
        assert parse_duration(f"{number}{blank}{duration}") == pytest.approx(number * seconds)
    for size, count in BYTES.items():
        assert parse_bytes(f"{number}{blank}{size}") == number * count


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


@examples(120)
@given(drawings)
def test_a_drawing_is_held_as_it_looks_or_refused(text: str) -> None:
    """The scene that ``refine`` starts from looks as the SVG."""
    try:
        scene, background = load_scene(text, WIDTH, HEIGHT, "made up")
    except ImageError as error:
        message, _ = explain(error)
        assert message.isprintable() and message.startswith("made up: ")
        return
    svg = write_svg(scene, background=background)
    own, large = f'width="{WIDTH}" height="{HEIGHT}"', f'width="{8 * WIDTH}" height="{8 * HEIGHT}"'
    held, shown = (on_white(render_own(t.replace(own, large, 1))) for t in (svg, text))
    assert held.shape == (8 * HEIGHT, 8 * WIDTH, 3)
    assert psnr(held, shown) > FAITHFUL, text


FAITHFUL = 30.0
"""Least PSNR of a scene read from an SVG [dB]; a lost dash costs more than twenty."""
