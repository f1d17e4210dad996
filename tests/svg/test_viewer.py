"""Foreign SVGs are read, checked, measured and drawn without harm."""

from __future__ import annotations

import gzip
import itertools
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import Cli, one_line, run
from tests.scenes import disc
from tests.svg.foreign import HEAD, PATH, SMALL
from warpsplat.errors import ImageError
from warpsplat.svg import inspect as inspect_module
from warpsplat.svg import viewer
from warpsplat.svg.inspect import MAX_DEPTH, inspect_svg, read_svg_text, svg_size
from warpsplat.svg.viewer import draw_png, on_white, render_own, render_svg
from warpsplat.svg.write import write_svg

CRASHES = {
    "panic": '<path stroke="red" fill="none" stroke-width="1e30" d="M0 0h900v900"/>',
    "abort": '<circle cx="2147483648" cy="5" r="2147483648"/>',
}


@pytest.mark.parametrize("name", CRASHES)
def test_crashes_of_resvg_are_one_line(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str], cli: Cli
) -> None:
    svg, image = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_text(f"{SMALL}{CRASHES[name]}</svg>")
    Image.new("RGB", (40, 30)).save(image)
    for arguments in (("render", svg, "-o", tmp_path / "b.png"), ("eval", image, svg)):
        assert run(*arguments) == 3
        message = f"warpsplat: {svg}: cannot be rendered: the renderer crashed"
        assert one_line(capfd.readouterr().err) == message
    assert cli("refine", svg, image, "-o", tmp_path / "b.svg", code=3).line.startswith(f"warpsplat: {svg}: ")


def test_a_panic_on_a_text_of_our_own_is_an_error() -> None:
    with pytest.raises(ImageError, match="resvg fails"):
        render_own(f"{SMALL}{CRASHES['panic']}</svg>")


def test_deep_nesting_is_drawn_or_refused() -> None:
    count = MAX_DEPTH - 2
    deep = f"{SMALL}{'<g>' * count}<rect width='40' height='30' fill='red'/>{'</g>' * count}</svg>"
    assert render_svg(deep).convert("RGB").getpixel((20, 15)) == (255, 0, 0)
    with pytest.raises(ImageError, match="nested more than"):
        render_svg(f"{SMALL}{'<g>' * 100_000}")


def test_time_and_memory_of_a_drawing_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("resource", reason="the system has no such limits")
    turbulence = '<filter id="f"><feTurbulence numOctaves="9999999"/></filter>'
    endless = f'{SMALL}{turbulence}<rect width="40" height="30" filter="url(#f)"/></svg>'
    monkeypatch.setattr(viewer, "CPU_SECONDS", 1.0)
    monkeypatch.setattr(viewer, "WALL_FACTOR", 60)  # for a busy machine
    with pytest.raises(ImageError, match="within 1 s of processor time"):
        render_svg(endless)
    monkeypatch.setattr(viewer, "WALL_FACTOR", 0.2)
    with pytest.raises(ImageError, match=r"within 0.2 s"):
        render_svg(endless)
    monkeypatch.undo()
    monkeypatch.setattr(viewer, "MEMORY", 300 << 20)
    layers = '<g opacity=".5">' * 30 + '<path d="M0 0h9000v9000"/><path d="M0 0h9000v8000"/>' + "</g>" * 30
    with pytest.raises(ImageError, match="MiB of memory"):
        render_svg(f'{HEAD}width="9000" height="9000">{layers}</svg>', zoom=1)


SIDES = ["", "50", "20.5", "50%", "10em", "1cm", "10pt", "3q", "abc", " 50", "+7", ".5e1", "0.3", "50PX"]
SIDES += ["nan"]
BOXES = ["", *["0 0 30 20", "0,0,30,20.4", " 1 , 2 , 30 , 20 ", "0,,0 30 20", "0-5 30 20 9", "0 0 30px 20"]]
BOXES += ["0 0 0 5", "0 0 nan 5"]
SIZES = [
    *(f'width="{w}" height="{h}"' for w, h in itertools.pairwise([*SIDES, *SIDES[::2]])),
    *(f'viewBox="{box}" width="{side}"' for box, side in zip(2 * BOXES, SIDES, strict=False)),
    *(f'viewBox="{box}" height="{side}" width="60"' for box, side in zip(BOXES, SIDES[1:], strict=False)),
    'font-size="10" width="5em" height="3em"',
    'style="width:20px;height:30px"',
]


@pytest.mark.parametrize("attributes", SIZES)
def test_size_is_what_the_viewer_makes(attributes: str) -> None:
    text = f"{HEAD}{attributes}>{PATH}</svg>"
    drawn = render_svg(text).size
    size = svg_size(inspect_svg(text).root)
    if size:
        assert drawn == tuple(max(1, int(side + 0.5)) for side in size)
        assert render_svg(text, zoom=3).size == tuple(int(3 * side + 0.5) for side in drawn)
    else:  # the extent of the path
        assert drawn == (70, 40) or "font-size" in attributes


@pytest.mark.parametrize(
    ("attributes", "zoom"),
    [
        *((f'width="{w}" height="5"', None) for w in ("9" * 400, "1e200", "4294967296", "0", "-4")),
        *((f'viewBox="0 0 {box}"', None) for box in ("1e30 1e30", "1e-300 1e300")),
        *(('width="40" height="30"', zoom) for zoom in (1e9, 1e308, float("inf"))),
    ],
)
def test_absurd_sizes_are_refused_before_drawing(
    attributes: str, zoom: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("warpsplat.svg.viewer.subprocess.run", None)
    with pytest.raises(ImageError, match=r"million|not positive"):
        draw_png(f"{HEAD}{attributes}>{PATH}</svg>", zoom=zoom)


def test_pillows_limit_does_not_apply_to_renderings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    assert render_svg(f"{SMALL}{PATH}</svg>").size == (40, 30)
    assert on_white(render_own(write_svg(disc(10, 30, 15)))).shape == (30, 30, 3)


@pytest.mark.parametrize("text", ["", "hello", "<html/>", "<svg/>", f"{SMALL}<g></svg>", f"{SMALL}\0</svg>"])
def test_not_svg(text: str) -> None:
    with pytest.raises(ImageError, match=r"not an SVG|cannot be rendered"):
        render_svg(text)


ENCODED = {
    **{"utf-8-sig": "", "utf-16": "UTF-16", "utf-16-le": "UTF-16", "utf-16-be": "UTF-16"},
    **{"latin-1": "ISO-8859-1", "cp1252": "windows-1252"},
}


@pytest.mark.parametrize("codec", ENCODED)
@pytest.mark.parametrize("packed", [False, True])
def test_encodings(codec: str, packed: bool, tmp_path: Path) -> None:
    declaration = f'<?xml version="1.0" encoding="{ENCODED[codec]}"?>' if ENCODED[codec] else ""
    data = f"{declaration}{SMALL}<title>Größe</title>{PATH}</svg>".encode(codec)
    svg = tmp_path / "a.svg"
    svg.write_bytes(gzip.compress(data) if packed else data)
    text = read_svg_text(svg)
    assert "Größe" in text
    assert text.startswith('<?xml version="1.0" encoding="UTF-8"?>' if declaration else "<svg")
    assert run("render", svg, "-o", tmp_path / "a.png") == 0


@pytest.mark.parametrize("encoding", ["hex", "punycode", "none-such", "UTF-16", "unicode_escape"])
def test_unknown_encodings(encoding: str, tmp_path: Path) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text(f'<?xml version="1.0" encoding="{encoding}"?>{SMALL}</svg>')
    with pytest.raises(ImageError, match=r"a\.svg: not an SVG"):
        read_svg_text(svg)


def test_a_packed_file_is_unpacked_within_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inspect_module, "MAX_BYTES", 1 << 20)
    svg = tmp_path / "a.svgz"
    svg.write_bytes(gzip.compress(SMALL.encode() + bytes(50 << 20)))
    with pytest.raises(ImageError, match="larger than 1 MiB when unpacked"):
        read_svg_text(svg)


LAUGHS = "".join(f'<!ENTITY l{i} "{10 * f"&l{i - 1};"}">' for i in range(1, 12))


@pytest.mark.parametrize(
    ("entity", "body", "message"),
    [
        (f'l0 "ha">{LAUGHS[:-1]}', "<title>&l11;</title>", "expands to too much"),
        (f'a "{"a" * 50_000}"', f'<g id="{"&a;" * 50_000}"/>', "expands to too much"),
        (f'x SYSTEM "{Path(__file__).as_uri()}"', '<path d="&x;"/>', "cannot be rendered"),
    ],
    ids=["laughs", "square", "external"],
)
def test_entities_that_are_refused(entity: str, body: str, message: str) -> None:
    with pytest.raises(ImageError, match=message):
        inspect_svg(f"<!DOCTYPE svg [<!ENTITY {entity}>]>{SMALL}{body}</svg>")


SHAPES = (
    '<rect x="2" width="9" height="9"/><circle r="3"/><ellipse rx="3" ry="2"/><line x2="3" y2="3"/>'
    '<polyline points="0,0 3,3"/><polygon points="0,0 3,3 3,0"/><path d="M0 0h9v9z"/>'
)
GROUND = '<rect width="40" height="30" fill="red"/>'


@pytest.mark.parametrize(
    ("body", "paths", "nodes"),
    [
        (SHAPES, 7, 9),
        (GROUND + SHAPES, 7, 9),
        ('<rect width="100%" height="100%"/>' + SHAPES, 7, 9),
        (SHAPES + GROUND, 8, 10),
        (2 * GROUND + SHAPES, 8, 10),
        ('<rect width="40" height="29"/>' + SHAPES, 8, 10),
        ('<rect width="40" height="30" rx="5"/>' + SHAPES, 8, 10),
        (GROUND, 1, 1),
        (f'<defs><g id="a">{SHAPES}</g></defs><use href="#a"/><use href="#a" x="9"/>', 7, 9),
        (f'<clipPath id="c">{SHAPES}</clipPath><mask id="m">{SHAPES}</mask><path d="M0 0h9"/>', 1, 2),
        ("<text>a</text>", 0, 0),
        *(
            (f'<path d="{data}"/>', 1, nodes)
            for data, nodes in (
                ("m0 0a1 1 0 012 2 1 1 0 0 0 5 5", 3),
                ("M1e-1 2e-5L3 4", 2),
                ("z", 0),
                ("M0 0c1 1 2 2 3 3 1 1 2 2 3 3z", 3),
                ("M0,0L1-1.5.5,2H3V4Z", 5),
                ("m0 0a1 1 0 0 1 2 2q1 1 2 2t1 1", 4),
            )
        ),
    ],
)
def test_paths_and_nodes(body: str, paths: int, nodes: int) -> None:
    """Each path counts once, except a background, clips and masks."""
    facts = inspect_svg(f'{HEAD}width="40" height="30">{body}</svg>')
    assert (facts.paths, facts.nodes) == (paths, nodes)
    sized = f'{HEAD}width="4in" viewBox="0 0 40 30">{body}</svg>'
    assert (inspect_svg(sized).paths, inspect_svg(sized).nodes) == (paths, nodes)
