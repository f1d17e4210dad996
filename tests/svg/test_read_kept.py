"""Elements that no path can show are kept in their place, and look the same."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import resvg_py
from PIL import Image

from tests.fuzz.corpus import saved
from tests.svg.foreign import HEAD, load_scene
from warpsplat.errors import ImageError
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.svg.read import load_kept
from warpsplat.svg.viewer import on_white
from warpsplat.svg.write import write_svg

BLUR = '<filter id="f"><feGaussianBlur stdDeviation="2"/></filter>'


DOT = base64.b64encode(saved(Image.new("RGB", (2, 2), "red"), "PNG")).decode()
BELOW, ABOVE = '<path d="M2 2h30v20h-30z" fill="#6ac"/>', '<path d="M15 8l20 3l-9 15z" fill="#a33"/>'

KEPT = {
    "filter": f'{BLUR}<circle cx="15" cy="12" r="7" fill="red" filter="url(#f)"/>',
    "filter of a group": f'{BLUR}<g filter="url(#f)"><path d="M5 5h9v9z"/><path d="M9 9h9v9z" '
    'fill="red"/></g>',
    "mask": '<defs><mask id="m"><circle cx="12" cy="12" r="8" fill="#fff"/></mask></defs><rect width="30" '
    'height="15" mask="url(#m)"/>',
    "mask by attributes above": '<g fill="#fff"><mask id="m"><circle cx="12" cy="12" '
    'r="8"/></mask></g><rect width="30" height="15" mask="url(#m)"/>',
    "clip": '<clipPath id="c"><circle cx="12" cy="12" r="8"/></clipPath><g clip-path="url(#c)"><rect '
    'width="30" height="25" fill="red"/><path d="M0 9h40v4h-40z"/></g>',
    "pattern that links": '<pattern id="q" width="4" height="4" patternUnits="userSpaceOnUse"><path d="M0 '
    '0h2v4z" fill="red"/></pattern><pattern id="p" href="#q"/><ellipse cx="15" cy="12" rx="9" ry="8" '
    'fill="url(#p)"/>',
    "image": f'<image x="4" y="3" width="16" height="16" href="data:image/png;base64,{DOT}"/>',
    "markers": '<marker id="k" markerWidth="3" markerHeight="3"><path d="M0 0h3v3z" '
    'fill="red"/></marker><path d="M3 3l15 5l4 12" fill="none" stroke="#000" stroke-width="2" '
    'marker-mid="url(#k)"/>',
    "a stroke that is stretched": '<g transform="scale(2 .7)"><circle cx="8" cy="15" r="6" stroke="red" '
    'stroke-width="3" fill="none"/></g>',
    "opacity of a group": '<g opacity=".5"><path d="M2 2h9v9z"/><path d="M5 4h9v9z" fill="red"/></g>',
    "opacity over what is kept": f'{BLUR}<g opacity=".5"><path d="M2 2h9v9z"/><path d="M5 4h9v9z" '
    'fill="red" filter="url(#f)"/></g>',
    "a link": f'{BLUR}<g id="a"><path d="M2 2h9v9z" filter="url(#f)"/></g><use href="#a" x="9" fill="red"/>',
    "a link to what is refined": '<path id="a" d="M2 2h9v9z" fill="#050"/><use href="#a" x="9" '
    'mask="url(#m)"/><mask id="m"><path d="M0 0h20v7h-20z" fill="#fff"/></mask>',
    "inherited style": f'{BLUR}<g fill="red" stroke="#00f" stroke-width="2" transform="rotate(9)"><g '
    'opacity="1"><path d="M5 5h9v9z" filter="url(#f)"/></g></g>',
    "style sheet": f"<style>#a > .b, .c path{{fill:red}} g path.b{{stroke:blue}} "
    f'svg{{stroke-width:3}}</style>{BLUR}<g id="a"><path class="b" d="M5 3h9v9z" filter="url(#f)"/></g><g '
    'class="c"><path d="M9 12h9v9z" style="filter:url(#f)"/></g>',
    "blending": '<path d="M5 3h20v9z" fill="#fa0" style="mix-blend-mode:multiply"/>',
    "blending in a group that is cut off": '<clipPath id="c"><rect x="3" y="3" width="20" '
    'height="15"/></clipPath><g clip-path="url(#c)"><path d="M2 2h9v9z" fill="#0f0"/><path d="M1 1h20v9z" '
    'fill="#fa0" style="mix-blend-mode:multiply"/></g>',
    "blending in isolation": '<g style="isolation:isolate"><path d="M2 2h9v9z" fill="#0f0"/><path d="M1 '
    '1h20v9z" fill="#fa0" style="mix-blend-mode:multiply"/></g>',
    "a stroke that is cut off": '<clipPath id="c"><rect x="3" y="3" width="20" height="15"/></clipPath><g '
    'clip-path="url(#c)"><path d="M5 5h9v9z"/><path d="M1 9h25" stroke="red" stroke-width="3"/></g>',
    "a nested viewport": f'{BLUR}<svg x="5" y="4" width="50%" height="20" viewBox="0 0 10 10"><rect x="1" '
    'y="10%" width="80%" height="8" fill="teal" filter="url(#f)"/></svg>',
    "a switch": '<switch><path systemLanguage="xx" d="M0 0h9v9z"/><path d="M5 5h9v9z"/></switch>',
    "text": '<text x="3" y="15" font-size="14" font-family="DejaVu Sans, Liberation Sans">Ag</text>',
}


def shows(text: str, width: int = 40, height: int = 30) -> np.ndarray:
    png = resvg_py.svg_to_bytes(
        svg_string=text, width=width, height=height, dpi=96.0, skip_system_fonts="<text" not in text
    )
    return on_white(Image.open(io.BytesIO(bytes(png))))


@pytest.mark.parametrize("name", KEPT)
def test_it_looks_the_same(name: str, device: str) -> None:
    """In the file, and, except for blending, in our renderer."""
    text = f'{HEAD}width="40" height="30">{BELOW}{KEPT[name]}{ABOVE}</svg>'
    with pytest.raises(ImageError, match="not supported"):
        load_scene(text, 40, 30, "a.svg")
    read = load_kept(text, 40, 30, "a.svg")
    assert read.kept
    written, shown = write_svg(read.scene), shows(text)
    ElementTree.fromstring(written)
    assert psnr(shown, shows(written)) > 40
    if "blending" not in name:
        assert read.scene.pictures[0].pixels.any() or name == "text", "where there are no fonts"
        assert psnr(255 * render(read.scene, backend=Backend.on(device)), shown) > 34


@pytest.mark.parametrize(
    "root",
    [
        'width="80" height="60" viewBox="0 0 40 30"',
        'width="40mm" height="30mm" viewBox="-5 -3 50 36" preserveAspectRatio="xMinYMax"',
        'viewBox="0 0 40 30" fill="#070" id="r" class="x"',
        'width="4in" height="3in"',
    ],
)
def test_units_of_the_root(root: str) -> None:
    body = (
        f'<style>#r circle{{opacity:.5}}</style>{BLUR}<path d="M2 2h30v20z"/><circle cx="15" cy="12" r="7" '
    )
    text = f'{HEAD}{root}>{body}stroke="red" filter="url(#f)"/><path d="M9 9h5v9z" fill="#00f"/></svg>'
    read = load_kept(text, 80, 60, "a.svg")
    assert psnr(shows(text, 80, 60), shows(write_svg(read.scene), 80, 60)) > 35


def test_markup_is_untouched(tmp_path: Path) -> None:
    """The text is the same, with comments; identifiers are unique."""
    own = '<g  filter = "url(#f)"><!-- so --><path\n d="M5 5h9v9z" fill="url(#g0)"/></g>'
    ramp = '<linearGradient id="g0"><stop stop-color="red"/><stop offset="1"/></linearGradient>'
    shape = '<path d="M3 3h20v5z" fill="url(#g0)"/>'
    text = f'{HEAD}width="40" height="30">{BLUR}{ramp}<g id="layer">{own}{shape}{own}</g></svg>'
    written = write_svg(load_kept(text, 40, 30, "a.svg").scene)
    assert written.count(own) == 2
    for name in ("f", "g0", "layer"):
        assert written.count(f' id="{name}"') == 1, name
        assert 'fill="url(#gg0)"/>' in written
    assert psnr(shows(text), shows(written)) > 40


def test_entities_and_name_spaces() -> None:
    text = (
        '<!DOCTYPE s:svg [<!ENTITY red "#f00">]><s:svg xmlns:s="http://www.w3.org/2000/svg" '
        'xmlns:l="http://www.w3.org/1999/xlink" width="40" height="30"><s:defs><s:mask id="m"><s:path '
        'd="M0 0h20v9h-20z" fill="#fff"/></s:mask></s:defs><s:path d="M5 5h30v20z"/>'
        '<s:g mask="url(#m)"><s:rect width="30" height="20" fill="&red;"/></s:g>'
        "</s:svg>"
    )
    written = write_svg(load_kept(text, 40, 30, "a.svg").scene)
    assert "&red;" not in written
    assert 'xmlns=""' in written
    assert psnr(shows(text), shows(written)) > 40


def test_style_sheets_apply_to_kept_elements_only() -> None:
    """Even those inside them; the root's own size applies to the root only."""
    sheet = "<style>path{stroke:blue} svg{fill:#070}</style>"
    text = (
        f'{HEAD}width="40" height="30" style="width:9px; stroke-width:3; height:100%">{BLUR}{BELOW}'
        f'<g filter="url(#f)">{sheet}<path d="M5 5h9v9z"/></g>'
        '<path d="M15 8l20 3l-9 15z" style="stroke:none"/></svg>'
    )
    written = write_svg(load_kept(text, 40, 30, "a.svg").scene)
    assert written.count("<style>") == 1
    assert ".kept0 path{" in written
    assert ' style=" stroke-width:3; "' in written
    assert psnr(shows(text), shows(written)) > 40


def test_neighbours_share_a_picture() -> None:
    text = (
        f'{HEAD}width="40" height="30">{BELOW}<text>a</text><g><text>b</text></g>{ABOVE}<text>c</text></svg>'
    )
    read = load_kept(text, 40, 30, "a.svg")
    assert len(read.scene.pictures) == 2
    assert read.scene.picture.tolist() == [-1, 0, -1, 1]
    assert read.kept.startswith("3 <text>")
    markup = read.scene.pictures[0].markup
    assert markup.index(">a<") < markup.index(">b<")


def test_invisible_elements_are_reported() -> None:
    body = f'{BELOW}<image href="elsewhere.png" width="9" height="9"/>{ABOVE}'
    read = load_kept(f'{HEAD}width="40" height="30">{body}</svg>', 40, 30, "a.svg")
    assert read.kept == "<image>; 1 of 1 such places show nothing here"
    assert "elsewhere.png" in write_svg(read.scene)


TEXT = "<path d='M2 2h9v9z'/><text>a</text>"
ENTITY = "<!DOCTYPE svg [<!ENTITY p \"<path d='M0 0h9v9z'/>\">]>"


@pytest.mark.parametrize(
    ("before", "root", "body", "message"),
    [
        ("", "", "<text>a</text>", "contains no path to refine: <text>"),
        ("", "", '<rect width="40" height="30" fill="red"/><text>a</text>', "contains no path to refine"),
        ("", "", f"<style>text + text{{fill:red}}</style>{TEXT}", "'text \\+ text'"),
        ("", "", f"<style>path:first-child{{x:y}}</style>{TEXT}", "first-child"),
        ("", 'filter="url(#f)"', TEXT, "filter"),
        ("", 'transform="scale(2)"', TEXT, "transform"),
        ("", 'opacity=".5"', TEXT, "opacity"),
        (ENTITY, "", "&p;<text>a</text>", "entities"),
    ],
)
def test_refusals(before: str, root: str, body: str, message: str) -> None:
    with pytest.raises(ImageError, match=message) as caught:
        load_kept(f'{before}{HEAD}width="40" height="30" {root}>{body}</svg>', 40, 30, "a.svg")
    assert len(str(caught.value).splitlines()) == 1
