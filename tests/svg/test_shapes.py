"""What a scene cannot hold of an SVG is named."""

from __future__ import annotations

import pytest

from tests.cli.helpers import one_line
from tests.svg.foreign import HEAD, ROUND
from warpsplat.errors import ImageError
from warpsplat.svg.read import load_scene

LOST = {
    f'<path d="M1 1h9v9" {ROUND} stroke-dasharray="2"/>': "dashes",
    '<path d="M1 1h9" fill="none" stroke="red"/>': "butt caps",
    '<path d="M1 1h9v9" fill="none" stroke="red" style="stroke-linecap:square"/>': "square caps",
    '<path d="M1 1h9v9z" fill="none" stroke="red"/>': "miter joins",
    '<g fill-rule="evenodd"><path d="M2 2h30v20h-30zM5 5h9v9h-9z"/></g>': "even-odd",
    '<polygon fill-rule="evenodd" points="20,1 30,28 3,10 37,10 8,28"/>': "even-odd",
    '<path d="M1 1h9v9z" style="mix-blend-mode:multiply"/>': "mix-blend-mode",
    '<g opacity=".5"><path d="M1 1h9v9z"/><path d="M1 1h9v9z"/></g>': "opacity of a group",
    '<symbol id="s"><path d="M1 1h9v9z"/></symbol><use href="#s"/>': "<use>",
    '<switch><path d="M1 1h9v9z"/><path d="M1 1h9v9z"/></switch>': "<switch>",
    '<svg><path d="M1 1h9v9z"/></svg>': "<svg> inside",
    "<text>a</text>": "<text>",
    '<image href="a.png"/>': "<image>",
    '<g style="clip-path:url(#a)"/>': "clip-path",
    '<g mask="url(#a)"/>': "mask",
    '<path filter="url(#a)"/>': "filter",
    '<path d="M1 1h9v9z" fill="url(#a)"/>': "gradient",
    f'<path d="M1 1h9v9" {ROUND} marker-end="url(#a)"/>': "markers",
    f'<path d="M1 1h9v9" {ROUND} vector-effect="non-scaling-stroke"/>': "vector-effect",
    f'<path d="M1 1h9v9" {ROUND} transform="scale(1,2)"/>': "stretches",
    f'<path d="M1 1h9M2 0v9" {ROUND} opacity=".5"/>': "several subpaths",
    '<path d="M1 1h9v9z"><animate attributeName="d"/></path>': "animation",
    "<style>g path{fill:red}</style>": "selector",
    "<style>@media print{path{fill:red}}</style>": "@-rules",
    '<path d="M1 1h9v9z" fill="bogus"/>': "'bogus' is not a colour",
    '<circle cx="1em" cy="5" r="1em"/>': "'1em'",
    '<path d="z"/>': "draws no",
    '<path d="M1 1h9v9zL"/>': "broken",
    '<path d="M1 1h1e30v9z"/>': "farther than",
    f'<path d="M1 1h9v9" {ROUND} stroke-width="1e30"/>': "farther than",
    '<path d="M1 1h9e999v9z"/>': "farther than",
    10 * '<g transform="scale(1e40)">' + '<path d="M1 1h9v9z"/>' + 10 * "</g>": "farther than",
    '<path d="M1 1h9v9z" transform="spin(5)"/>': "transform",
    '<path d="M1 1h9v9z" visibility=";"/>': "visibility",
    "<style>.a{fi 9:red;fill:red}</style>": "broken",
}


@pytest.mark.parametrize("body", LOST)
def test_what_would_be_lost_is_named(body: str) -> None:
    with pytest.raises(ImageError) as caught:
        load_scene(f'{HEAD}width="40" height="30">{body}</svg>', 40, 30, "a.svg")
    assert str(caught.value).startswith("a.svg: ")
    assert LOST[body] in one_line(str(caught.value))


@pytest.mark.parametrize(
    "size", ['width="nan" height="nan"', 'width="a" height="b" viewBox="nan nan nan nan"', ""]
)
def test_sizes_that_are_no_numbers(size: str) -> None:
    with pytest.raises(ImageError, match="neither its size"):
        load_scene(f'{HEAD}{size}><path d="M1 1h9v9z"/></svg>', 40, 30, "a.svg")
