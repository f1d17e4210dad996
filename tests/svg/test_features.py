"""SVGs of all features, read, rendered and written again, look as resvg shows them, or are refused."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cli.helpers import one_line
from tests.svg.foreign import FOREIGN, HEAD, ROUND, load_scene
from warpsplat.errors import ImageError
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Scene
from warpsplat.svg.viewer import on_white, render_own, render_svg
from warpsplat.svg.write import write_svg

LINK = 'xmlns:xlink="http://www.w3.org/1999/xlink" '
RAMP = '<stop stop-color="#fc0"/><stop offset="60%" stop-color="#06c" stop-opacity=".4"/><stop offset="1"/>'
STAR = "20,1 30,28 3,10 37,10 8,28"

STRUCTURE = {
    "use": f'<defs><rect id="a" width="9" height="7"/><use {LINK}id="b" xlink:href="#a" x="12"/></defs>'
    '<g fill="red"><use href="#a" x="3" y="3"/></g><use href="#b" y="15" fill="blue"/>',
    "use of a group": '<g id="a"><path d="M2 2h8v5z"/><circle cx="15" cy="6" r="4" fill="red"/></g>'
    '<use href="#a" transform="translate(9 12) rotate(9)" fill="green"/>',
    "recursive use": '<g id="a"><use href="#a" x="9"/><path d="M2 2h20v15z"/></g><use href="#none"/>',
    "symbol": '<symbol id="a" viewBox="0 0 10 10" opacity=".7"><circle cx="5" cy="5" r="5"/></symbol>'
    '<use href="#a" x="5" y="3" width="20" height="24"/>',
    "a symbol cut off": '<symbol id="a"><circle cx="5" cy="9" r="8" fill="red"/></symbol>'
    '<use href="#a" x="12" y="6" width="10" height="12"/>',
    "a nested viewport": '<svg x="5" y="4" width="50%" height="20" viewBox="0 0 10 10">'
    '<rect x="1" y="10%" width="80%" height="8" fill="teal"/></svg>',
    "a viewport cut off": '<g transform="rotate(9)"><svg x="8" y="4" width="16" height="15">'
    '<circle cx="3" cy="9" r="12" fill="teal"/><path d="M6-5h9v40h-9zM9 2h3v9h-3z" fill="red"/></svg></g>',
    "clipped by a rectangle": '<clipPath id="a" transform="rotate(5)"><rect x="5" y="4" width="20" '
    'height="15"/></clipPath><g clip-path="url(#a)"><circle cx="9" cy="9" r="12" fill="red"/>'
    '<path d="M20 9h9v20z"/><path d="M30 0h9v9z"/></g>',
    "overflow": '<svg x="9" y="4" width="9" height="9" overflow="visible"><circle r="8" fill="teal"/></svg>',
    "opacity of a group": '<g opacity=".5"><path d="M2 2h9v9z"/><path d="M20 2h9v9z" opacity=".5"/></g>',
    "origin": '<rect x="9" y="9" width="15" height="9" transform="rotate(30)" transform-origin="50% top"/>',
    "unknown elements": '<what><rect width="30" height="30"/></what><path d="M9 3h9v9z"/>',
}
STYLE = {
    "selectors": "<style>g > .a, svg path.b[d]{fill:red} g .a:first-child{stroke:none}"
    "#c.b{fill:blue !important} path{fill:#0a0}</style>"
    '<g stroke="red"><path class="a" d="M2 2h9v9z"/><g><path class="a" d="M12 2h9v9z"/></g></g>'
    '<path class="b" d="M22 2h9v9z"/><path id="c" class="b" style="fill:lime" d="M2 14h20v9z"/>',
    "important": '<style>path{fill:red!important}</style><path style="fill:blue" d="M2 2h30v20z"/>',
    "strings": '<path style="font-family:\'a;fill:red\';fill:blue" d="M2 2h30v20z"/>',
    "another type": '<style type="text/other">path{fill:red}</style><path d="M2 2h30v20z"/>',
    "hues": '<path style="/* . */fill:hsl(200,50%,50%)" d="M2 2h30v20z"/>',
    "inherit": '<g fill="red" opacity=".7"><path fill="inherit" opacity="inherit" d="M2 2h30v20z"/></g>',
    "current colour": '<g fill="currentColor" color="red"><path color="#08f" d="M2 2h30v20z"/></g>',
    "units": '<g font-size="10"><rect x="1mm" y=".1in" width="1.5em" height="2ex" font-size="150%"/></g>'
    '<rect x="60%" y="10pt" width="1pc" height="30%"/>',
    "no colours": '<path fill="bogus" d="M2 2h9v9z"/><path fill="none" stroke="bogus" d="M12 2h9v9z"/>',
    "no opacity": '<path opacity="1mm" fill-opacity="x" d="M2 2h9v9z"/>',
    "context": '<defs><path id="a" d="M2 2h30v20z" fill="context-stroke"/></defs>'
    '<use href="#a" stroke="green"/>',
}
SHAPES = {
    "even-odd": f'<polygon fill-rule="evenodd" points="{STAR}"/>',
    "nonzero": f'<polygon points="{STAR} 9" fill="red"/>',
    "holes": '<path d="M2 2h36v26h-36zM5 5v9h9v-9zM18 5q9 0 9 9t-5 9" fill="red"/>',
    "data up to its error": '<path d="M2 2h20v20L4 9 3#7h9"/><path d="M30 2h8v8a2 2 0 6 0 5 5z"/>',
    "empty": '<path d=""/><rect width="0" height="9"/><circle r="-1"/><polyline points="3"/>'
    '<ellipse cx="9" cy="9" rx="5"/><rect x="20" y="5" width="12" height="9" rx="3"/>',
    "fill and stroke": f'<path d="M5 5h20q9 12-9 20z" {ROUND} style="fill:gold" stroke-width="3"/>'
    f'<path d="M30 5q9 2 4 20" {ROUND} style="fill:gold" stroke-width="4"/>',
    "stroke first": f'<path d="M5 5h20q9 12-9 20z" {ROUND} style="fill:gold" stroke-width="5" '
    'paint-order="stroke"/>',
    "strokes of several subpaths": f'<path d="M5 5h20M9 2v20zM20 20q9 0 9-9" {ROUND} opacity=".5" '
    'stroke-width="4"/>',
    "hidden": '<path visibility="hidden" d="M2 2h9v9z"/><g visibility="collapse">'
    '<path visibility="visible" d="M12 2h9v9z"/></g><g display="none"><path d="M2 9h9v9z"/></g>',
    "singular": '<path transform="scale(0)" d="M2 2h9v9z"/><path d="M12 2h9v9z"/>',
}
PAINTS = {
    "linear": f'<linearGradient id="a" x1="20%" y2=".5">{RAMP}</linearGradient>'
    '<path d="M2 2h36v26z" fill="url(#a)"/>',
    "of a taken over gradient": f'<linearGradient id="a" spreadMethod="reflect" x2=".3">{RAMP}'
    '</linearGradient><linearGradient id="b" href="#a" gradientTransform="rotate(20)"/>'
    '<path d="M2 2h36v26z" fill="url(\'#b\')" fill-opacity=".8"/>',
    "user space": f'<linearGradient id="a" gradientUnits="userSpaceOnUse" x1="5" x2="50%">{RAMP}'
    '</linearGradient><path d="M2 2h36v26z" fill="url(#a)" transform="skewX(9)"/>',
    "radial": f'<radialGradient id="a" cx=".4" fx=".3" fy="30%" fr=".1">{RAMP}</radialGradient>'
    '<path d="M2 2h36v26h-36z" fill="url(#a)"/>',
    "repeated": f'<radialGradient id="a" r=".2" spreadMethod="repeat">{RAMP}</radialGradient>'
    '<circle cx="20" cy="15" r="13" fill="url(#a)"/>',
    "on a stroke": f'<linearGradient id="a">{RAMP}</linearGradient>'
    '<path d="M5 5h30l-9 20" fill="none" stroke="url(#a)" stroke-width="4" stroke-linecap="round" '
    'stroke-linejoin="round"/>',
    "fallbacks": '<linearGradient id="a"/><path d="M2 2h9v9z" fill="url(#a) red"/>'
    '<path d="M12 2h9v9z" fill="url(#b) currentColor" color="blue"/><path d="M2 12h9v9z" fill="url(#b)"/>',
    "one stop": '<linearGradient id="a"><stop stop-color="red" stop-opacity=".5"/></linearGradient>'
    '<path d="M2 2h30v20z" fill="url(#a)"/>',
    "stops": '<linearGradient id="a" color="red" x1=".2" x2=".8"><stop/><stop stop-color="currentColor"/>'
    '<stop offset=".7" stop-color="blue"/><stop offset=".3" stop-color="lime"/></linearGradient>'
    '<path d="M2 2h36v26h-36z" fill="url(#a)"/>',
    "no radius": f'<radialGradient id="a" r="0">{RAMP}</radialGradient><path d="M2 2h9v9z" fill="url(#a)"/>',
}
LINES = {
    "caps": '<g stroke="red" stroke-width="6"><path d="M6 5h25"/><path d="M6 13h25" '
    'stroke-linecap="square"/><path d="M6 22h25" stroke-linecap="round"/></g>',
    "joins": '<g stroke="red" stroke-width="4" fill="none"><path d="M4 8l8 16 8-16"/>'
    '<path d="M22 8l3 16 3-16" stroke-linejoin="bevel"/><path d="M31 8l3 16 3-16z" '
    'stroke-miterlimit="9"/></g>',
    "beyond float32": '<path d="M4 8l8 16 8-16" fill="none" stroke="red" stroke-width="4" '
    'stroke-miterlimit="1e308"/><path d="M20 8l8 16 8-16" fill="none" stroke="red" stroke-width="4" '
    'stroke-dasharray="1e39 3"/>',
    "dashes": '<path d="M4 6h30l-9 20z" fill="#ffc" stroke="red" stroke-width="3" '
    'stroke-dasharray="5%, 2 1" stroke-dashoffset="-2"/>',
    "no dashes": '<path d="M4 8h30" stroke="red" stroke-width="4" stroke-dasharray="3 -1"/>'
    '<path d="M4 18h30" stroke="red" stroke-width="4" stroke-dasharray="0 0"/>',
}

GROUPS = (STRUCTURE, STYLE, SHAPES, PAINTS, LINES)


def _wrapped(body: str, more: str = "") -> str:
    return f'{HEAD}width="40" height="30" {more}>{body}</svg>'


def _read(body: str, more: str = "") -> Scene:
    return load_scene(_wrapped(body, more), 40, 30, "a.svg")[0]


@pytest.mark.parametrize(
    ("text", "rendered", "written"),
    # Strokes: resvg's antialiasing has 16 levels, and much of so small an image is edge.
    [(HEAD + text, 34 if "stroke" in name else 38, 38) for name, text in FOREIGN.items()]
    + [(_wrapped(body), 32, 36) for group in GROUPS for body in group.values()],
    ids=[name for group in (FOREIGN, *GROUPS) for name in group],
)
def test_it_looks_the_same(text: str, rendered: float, written: float) -> None:
    scene, _ = load_scene(text, 40, 30, "a.svg")
    shown = on_white(render_svg(text, size=(40, 30)))
    assert shown.std() > 20, "something is drawn"
    assert psnr(render(scene, backend=Backend.on("cpu")).astype(np.float64) * 255, shown) > rendered
    assert psnr(on_white(render_own(write_svg(scene))), shown) > written, "cut edges differ most"


@pytest.mark.parametrize("group", [STRUCTURE, SHAPES, PAINTS, LINES])
def test_reading_what_was_written_gives_the_same(group: dict[str, str]) -> None:
    for body in group.values():
        scene = _read(body)
        again, _ = load_scene(write_svg(scene, background=False), 40, 30, "a.svg")
        for name in ("kind", "rule", "twin", "paint", "spread", "cap", "join", "dash"):
            np.testing.assert_array_equal(getattr(again, name), getattr(scene, name), err_msg=name)
        np.testing.assert_allclose(again.widths, scene.widths, atol=0.01)
        np.testing.assert_allclose(again.stop_opacities, scene.stop_opacities, atol=1e-3)
        for a, b in zip(again.dashes, scene.dashes, strict=True):
            np.testing.assert_allclose(a, b, atol=0.01)


def test_a_fill_with_its_stroke_is_one_path_on_the_background_of_the_root() -> None:
    scene = _read(SHAPES["fill and stroke"], 'style="background-color:#08f"')
    assert scene.twin.tolist() == [0, 1, 0, 1]
    assert write_svg(scene).count("<path") == 2
    assert scene.canvas.background is not None
    np.testing.assert_allclose(scene.canvas.background, [0, 8 / 15, 1], atol=1e-6)


def test_links_that_multiply_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpsplat.svg.structure.MAX_LINKED", 1000)
    layers = '<g id="g0"><path d="M1 1h9v9z"/></g>'
    for i in range(9):
        layers += f'<g id="g{i + 1}">' + f'<use href="#g{i}"/>' * 10 + "</g>"
    with pytest.raises(ImageError, match="links add up to more than"):
        _read(f"<defs>{layers}</defs><use href='#g9'/>")


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
