"""Long rows of one character: texts for which a pattern that backtracks takes minutes.

Nothing is timed: if reading were not linear, a test would take from half an hour to a day.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.svg.foreign import load_scene
from warpsplat.errors import ImageError
from warpsplat.scene import Scene
from warpsplat.svg.gradients import parse_link
from warpsplat.svg.inspect import inspect_svg, path_nodes, read_svg_text, svg_size
from warpsplat.svg.read import load_kept

LONG = 1_000_000
SPACES, DIGITS = " " * LONG, "1" * LONG
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" width="32" height="24" '
PATH, FILLED = '<path d="M0 0h9v9z"/>', '<path fill="url(#a)" d="M0 0h9v9z"/>'
CLIP = '<clipPath id="c"><rect width="30" height="20"/></clipPath>'


def read(body: str) -> Scene:
    return load_scene(f"{HEAD}>{body}</svg>", 32, 24, "a.svg")[0]


@pytest.mark.parametrize("start", ["", '<?xml version="1.0" encoding="UTF-8"?>', SPACES], ids=range(3))
def test_spaces_anywhere_in_a_file(tmp_path: Path, start: str) -> None:
    path = tmp_path / "a.svg"
    path.write_text(f"{start}{HEAD}><desc>{SPACES}x</desc>{PATH}</svg>")
    assert read_svg_text(path) == path.read_text()


def test_invalid_sizes() -> None:
    for box in (f"0 0 32 {DIGITS}e", f"{DIGITS}e", f"0{SPACES},{SPACES}x"):
        assert svg_size(inspect_svg(f'{HEAD}viewBox="{box}">{PATH}</svg>').root) == (32, 24)
    assert svg_size({"width": f"{DIGITS}x", "height": "24"}) is None


@pytest.mark.parametrize("attribute", ["opacity", "stroke-width", "stroke-miterlimit"])
def test_invalid_numbers_are_ignored(attribute: str) -> None:
    plain, odd = (
        read(f'<path stroke="red" d="M0 0h9v9z"{more}/>') for more in ("", f' {attribute}="{DIGITS}x"')
    )
    for name in ("opacities", "widths", "miter_limits"):
        assert np.array_equal(getattr(plain, name), getattr(odd, name))


def test_the_text_of_a_file() -> None:
    assert inspect_svg(f"{HEAD}><!--{'<path ' * (LONG // 5)}--></svg>").paths == 0
    assert inspect_svg(f'{HEAD}><g style="fill:{SPACES}"/></svg>').nodes == 0
    assert path_nodes(DIGITS + "e" * LONG) == 0


def test_links_that_do_not_end() -> None:
    assert parse_link(f"url({SPACES}x") is None
    assert parse_link(f'url("{SPACES}x') is None
    assert parse_link(f"url( '#a b{SPACES}' ){SPACES}red") == ("a b", "red")
    assert parse_link("url(#a) none") == ("a", "none")
    assert parse_link('url("#a)b")') == ("a)b", "")
    assert parse_link('url("#a)b') == ('"#a', "b")


@pytest.mark.parametrize(
    "sheet", ["a" * LONG, LONG // 2 * "}a", "&lt;/style" * (LONG // 10)], ids=["no brace", "closed", "tags"]
)
def test_invalid_style_sheets_are_ignored(sheet: str) -> None:
    assert len(read(f"<style>{sheet}</style>{PATH}")) == 1


def gradients(count: int, last: str) -> str:
    """Return a chain of gradients that inherit from the next, and shapes filled with them."""
    chain = "".join(f'<linearGradient id="g{i}" href="#g{i + 1}"/>' for i in range(count))
    ramp = f'<linearGradient id="g{count}"{last}><stop stop-color="red"/><stop offset="1"/></linearGradient>'
    return chain + ramp + "".join(f'<path fill="url(#g{i})" d="M0 0h9v9z"/>' for i in range(count))


@pytest.mark.parametrize("last", ["", ' href="#g0"'], ids=["chain", "ring"])
def test_gradients_that_refer_to_one_another(last: str) -> None:
    assert len(read(gradients(99, last))) == 99


def test_gradients_in_a_ring_inherit_from_each_other() -> None:
    body = (
        '<linearGradient id="a" href="#b" x1="1"/><linearGradient id="b" href="#c" x1="2" x2="7"/>'
        '<linearGradient id="c" href="#a" gradientUnits="userSpaceOnUse" x2="9">'
        "<stop/><stop/></linearGradient>"
    )
    scene = read(body + "".join(f'<path fill="url(#{name})" d="M0 0h9v9z"/>' for name in "abc"))
    assert [(x, x + along) for x, along in scene.frames[:, [0, 2]].tolist()] == [(1, 7), (2, 7), (1, 9)]


REFUSED = {
    "colour": (f'<path fill="rgb({DIGITS}x,1,1)" d="M0 0h9v9z"/>', "."),
    "transform": (f'<path transform="scale({DIGITS}x)" d="M0 0h9v9z"/>', "."),
    "data": (f'<path d="M0 {DIGITS}xh9v9z"/>', "."),
    "closed data": (f'<path d="M0 0{"z" * (LONG // 5)}"/><text/>', "."),
    "smooth data": (f'<path d="M0 0h9{"S1 1 2 2" * (LONG // 10)}"/><text/>', "."),
    "radius": (f'<circle r="{DIGITS}x"/>', "."),
    "points": (f'<polygon points="{DIGITS}x 9 9 9"/>', "."),
    "at-rules": (f"<style>{'@charset ' * (LONG // 10)}</style>{PATH}", "@-rules"),
    "at-rule": (f"<style>@namespace{SPACES}</style>{PATH}", "@-rules"),
    "selector": (f"<style>[{SPACES}a{SPACES}b]{{fill:red}}</style>{PATH}", "selector"),
    # Two lengths that multiply.
    "rules": (f"<style>{5000 * 'g.a{fill:red}'}</style>" + 5000 * '<g class="a"/>', "too many style rules"),
    "words": (f'<style>{5000 * "[id~=x]{fill:red}"}</style><g id="{LONG * "x "}"/>', "too many style rules"),
    "dashes": (f'<g stroke="red" stroke-dasharray="{LONG * "1 "}">{PATH}</g>', "dasharray in more than"),
    "inherited": (
        f'<g paint-order="{LONG * "fill "}">{PATH}</g>',
        "paint-order in more than 1000 characters",
    ),
    "linked data": (
        f'<path id="a" d="M0 0{LONG // 100 * "h1"}"/>' + 300 * '<use href="#a"/>',
        "more than 100000 elements",
    ),
    "links": ("".join(f'<use id="u{i}" href="#u{i + 1}"/>' for i in range(9999)), "more than 1000 deep"),
    "gradients": (gradients(5000, ""), "inherits from more than 100"),
    "stops": (
        f'<linearGradient id="a">{2000 * "<stop/>"}</linearGradient>{501 * FILLED}',
        "more than 1000000 stops",
    ),
    "gradientTransform": (
        f'<linearGradient id="a" gradientTransform="{LONG * "scale(1)"}">{2 * "<stop/>"}</linearGradient>'
        + FILLED,
        "gradientTransform in more than 1000 characters",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name: str) -> None:
    body, message = REFUSED[name]
    with pytest.raises(ImageError, match=message):
        read(body)


def test_groups_that_clip_in_one_another(monkeypatch: pytest.MonkeyPatch) -> None:
    body = CLIP + 9 * '<g clip-path="url(#c)">' + 9 * PATH + 9 * "</g>"
    assert len(read(body)) == 9
    monkeypatch.setattr("warpsplat.svg.structure.MAX_WORK", 80)
    with pytest.raises(ImageError, match="too many shapes in nested groups"):
        read(body)


@pytest.mark.parametrize(
    "body",
    [
        f"<g{SPACES}><text>a</text></g>",
        f"<text a='url({SPACES}x'/>",
        f"<text a='href=&quot;#a{SPACES}x'/>",
        f"<style>{LONG * 'a'}</style><text>a</text>",
    ],
    ids=["tag", "link", "reference", "sheet"],
)
def test_spaces_in_kept_elements(body: str) -> None:
    assert len(load_kept(f"{HEAD}>{body}{PATH}</svg>", 32, 24, "a.svg").scene) == 2
