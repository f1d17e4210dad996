"""Long rows of one character: texts that a pattern with several ways to match takes minutes for.

Nothing is timed: what is not linear would take from half an hour to a day.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from warpsplat.errors import ImageError
from warpsplat.svg.inspect import inspect_svg, read_svg_text, svg_size
from warpsplat.svg.read import load_scene

LONG = 1_000_000
SPACES, DIGITS = " " * LONG, "1" * LONG
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" width="32" height="24" '
TRIANGLE = '<path d="M0 0h9v9z"/></svg>'


@pytest.mark.parametrize("start", ["", '<?xml version="1.0" encoding="UTF-8"?>', SPACES])
def test_spaces_anywhere_in_a_file(tmp_path: Path, start: str) -> None:
    path = tmp_path / "a.svg"
    path.write_text(f"{start}{HEAD}><desc>{SPACES}x</desc>{TRIANGLE}")
    assert read_svg_text(path) == path.read_text()


@pytest.mark.parametrize(
    "attributes",
    [f'viewBox="0 0 32 {DIGITS}e"', f'viewBox="{DIGITS}e"', f'viewBox="0{SPACES},{SPACES}x"'],
    ids=["a view box", "its first number", "its spaces"],
)
def test_a_view_box_that_is_none(attributes: str) -> None:
    assert svg_size(inspect_svg(f"{HEAD}{attributes}>{TRIANGLE}").root) == (32, 24)


def test_a_length_that_is_none() -> None:
    assert svg_size({"width": f"{DIGITS}x", "height": "24"}) is None


@pytest.mark.parametrize("attribute", ["opacity", "stroke-width", "stroke-miterlimit"])
def test_what_is_no_number_counts_as_not_said(attribute: str) -> None:
    path = '<path stroke="red" d="M0 0h9v9z"'
    plain, odd = (
        load_scene(f"{HEAD}>{path}{more}/></svg>", 32, 24, "a.svg")[0]
        for more in ("", f' {attribute}="{DIGITS}x"')
    )
    assert plain.opacities.tolist() == odd.opacities.tolist()
    assert plain.widths.tolist() == odd.widths.tolist()
    assert plain.miter_limits.tolist() == odd.miter_limits.tolist()


@pytest.mark.parametrize(
    "shape",
    [
        f'<path fill="rgb({DIGITS}x,1,1)" d="M0 0h9v9z"/>',
        f'<path transform="scale({DIGITS}x)" d="M0 0h9v9z"/>',
        f'<path d="M0 {DIGITS}xh9v9z"/>',
        f'<circle r="{DIGITS}x"/>',
        f'<polygon points="{DIGITS}x 9 9 9"/>',
    ],
    ids=["colour", "transform", "data", "radius", "points"],
)
def test_numbers_that_are_none(shape: str) -> None:
    with pytest.raises(ImageError):
        load_scene(f"{HEAD}>{shape}</svg>", 32, 24, "a.svg")
