"""SVGs with features that a scene cannot hold are refused."""

from __future__ import annotations

import pytest

from tests.cli.helpers import one_line
from tests.svg.foreign import HEAD, ROUND
from warpsplat.errors import ImageError
from warpsplat.svg.read import load_scene

LOST = {
    '<path d="M1 1h9v9z" style="mix-blend-mode:multiply"/>': "mix-blend-mode",
    '<g opacity=".5"><path d="M1 1h9v9z"/><path d="M1 1h9v9z"/></g>': "opacity of a group",
    '<path d="M1 1h9v9z" stroke="red" opacity=".5"/>': "opacity of a group",
    '<switch><path d="M1 1h9v9z"/><path d="M1 1h9v9z"/></switch>': "<switch>",
    "<text>a</text>": "<text>",
    '<defs><text id="a">a</text></defs><use href="#a"/>': "<text>",
    '<image href="a.png"/>': "<image>",
    "<foreignObject/>": "<foreignObject>",
    '<g style="clip-path:url(#a)"/>': "clip-path",
    '<clipPath id="a"><circle r="9"/></clipPath><g clip-path="url(#a)"/>': "clip-path",
    '<clipPath id="a" clipPathUnits="objectBoundingBox"><rect width="1" height="1"/></clipPath>'
    '<g clip-path="url(#a)"/>': "clip-path",
    '<g mask="url(#a)"/>': "mask",
    '<path filter="url(#a)"/>': "filter",
    '<pattern id="a"/><path d="M1 1h9v9z" fill="url(#a)"/>': "<pattern>",
    f'<path d="M1 1h9v9" {ROUND} marker-end="url(#a)"/>': "markers",
    '<circle r="9" style="marker:url(#a)"/>': "markers",
    f'<path d="M1 1h9v9" {ROUND} vector-effect="non-scaling-stroke"/>': "vector-effect",
    f'<path d="M1 1h9v9" {ROUND} transform="scale(1,2)"/>': "stretches",
    '<path d="M1 1h9v9" stroke="red" stroke-linejoin="miter-clip"/>': "miter-clip",
    '<path d="M1 1h9v9z" shape-rendering="crispEdges"/>': "shape-rendering",
    '<path d="M1 1h9v9z"><animate attributeName="d"/></path>': "animation, not supported: take the still SVG",
    '<path d="M1 1h9v9z" systemLanguage="en"/>': "conditions",
    "<style>g+path{fill:red}</style>": "selector",
    "<style>path:hover{fill:red}</style>": "selector",
    "<style>@media print{path{fill:red}}</style>": "@-rules",
    "<style>@keyframes a{to{fill:red}}</style>": "take the still SVG",
    "<style>@import url(a.css);</style>": "@-rules",
    "<style>.a{fi 9:red;fill:red}</style>": "is invalid",
    '<path d="M1 1h9v9z" style="fill:var(--a)"/>': "variables",
    '<rect style="width:9px" height="9"/>': "width by style",
    '<path d="M1 1h9v9z" fill="lab(50% 9 9)"/>': "'lab(50% 9 9)' is not a colour",
    '<path d="M1 1h9v9z" fill="rgb(0 9 9 / 50%)"/>': "is not a colour",
    '<circle cx="1rem" cy="5" r="1em"/>': "'1rem'",
    '<path d="z"/>': "draws no",
    '<path d="M1 1h1e30v9z"/>': "farther than",
    f'<path d="M1 1h9v9" {ROUND} stroke-width="1e30"/>': "farther than",
    '<path d="M1 1h9e999v9z"/>': "farther than",
    10 * '<g transform="scale(1e40)">' + '<path d="M1 1h9v9z"/>' + 10 * "</g>": "farther than",
    '<path d="M1 1h9v9z" transform="spin(5)"/>': "transform",
    '<path d="M1 1h9v9z" transform="translate(5px)"/>': "transform",
    '<path d="M1 1h9v9z" visibility=";"/>': "visibility",
    '<use href="b.svg#a"/>': "another file",
    f'<svg width="9" height="9"><path d="M1 1h19" {ROUND}/></svg>': "viewport cuts off",
    '<radialGradient id="a" fx="2"><stop/><stop offset="1"/></radialGradient>'
    '<path d="M1 1h9v9z" fill="url(#a)"/>': "focus",
    '<linearGradient id="a" gradientUnits="userSpaceOnUse" x2="1e39">'
    '<stop/><stop offset="1"/></linearGradient>'
    '<path d="M1 1h9v9z" fill="url(#a)"/>': "a gradient reaches farther than",
}


PATH = '<path d="M1 1h9v9z"/></svg>'
REFUSED = {f'{HEAD}width="40" height="30">{body}</svg>': cause for body, cause in LOST.items()} | {
    "hello": "cannot be rendered",
    HEAD + 'width="40" height="30"/>': "draws no",
    f'{HEAD}width="40" height="40">{PATH}': "proportions",
    f'{HEAD}width="40" height="30" viewBox="1e308 0 1 5">{PATH}': "viewBox is too far",
    f'{HEAD}width="nan" height="nan">{PATH}': "neither its size",
    f'{HEAD}width="a" height="b" viewBox="nan nan nan nan">{PATH}': "neither its size",
    f"{HEAD}>{PATH}": "neither its size",
}


@pytest.mark.parametrize("text", REFUSED)
def test_unsupported_features_are_named(text: str) -> None:
    with pytest.raises(ImageError) as caught:
        load_scene(text, 40, 30, "a.svg")
    assert str(caught.value).startswith("a.svg: ")
    assert REFUSED[text] in one_line(str(caught.value))
