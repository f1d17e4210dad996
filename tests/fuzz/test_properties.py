"""SVGs from hypothesis, of features that ``refine`` supports and of others, look the same once read."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
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
from tests.svg.foreign import load_scene
from warpsplat.errors import ImageError, explain
from warpsplat.metrics import psnr
from warpsplat.svg.viewer import on_white, render_own
from warpsplat.svg.write import write_svg

pytestmark = pytest.mark.slow


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


@settings(max_examples=120, derandomize=True, database=None, deadline=None)
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
