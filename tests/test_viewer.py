"""Foreign SVGs: checked, measured and drawn without harm."""

from __future__ import annotations

import gzip
import io
import itertools
import json
from pathlib import Path

import pytest
from PIL import Image

from tests.scenes import disc
from tests.test_cli import one_line, run
from warpsplat.errors import ImageError
from warpsplat.svg import inspect as inspect_module
from warpsplat.svg import viewer
from warpsplat.svg.inspect import MAX_DEPTH, inspect_svg, path_nodes, read_svg_text, svg_size
from warpsplat.svg.viewer import draw_png, on_white, render_own, render_svg
from warpsplat.svg.write import write_svg

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" '
SMALL = HEAD + 'width="40" height="30">'
PATH = '<path d="M10 10H70V40Z"/>'

CRASHES = {
    "panic": '<path stroke="red" fill="none" stroke-width="1e30" d="M0 0h900v900"/>',
    "abort": '<circle cx="2147483648" cy="5" r="2147483648"/>',
}


@pytest.mark.parametrize("name", CRASHES)
def test_what_ends_resvg_is_one_line(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    svg, image = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_text(f"{SMALL}{CRASHES[name]}</svg>")
    Image.new("RGB", (40, 30)).save(image)
    for arguments in (("render", svg, "-o", tmp_path / "b.png"), ("eval", image, svg)):
        assert run(*arguments) == 3
        assert (
            one_line(capfd.readouterr().err)
            == f"warpsplat: {svg}: cannot be rendered: resvg fails on what it draws"
        )
    assert run("refine", svg, image, "-o", tmp_path / "b.svg") == 3
    assert one_line(capfd.readouterr().err).startswith(f"warpsplat: {svg}: ")


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


SIDES = [
    "",
    "50",
    "20.5",
    "50%",
    "10em",
    "1cm",
    "10pt",
    "3q",
    "abc",
    " 50",
    "+7",
    ".5e1",
    "0.3",
    "50PX",
    "nan",
]
BOXES = [
    "",
    "0 0 30 20",
    "0,0,30,20.4",
    " 1 , 2 , 30 , 20 ",
    "0,,0 30 20",
    "0-5 30 20 9",
    "0 0 30px 20",
    "0 0 0 5",
    "0 0 nan 5",
]
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
    else:  # the root does not say: the extent of the path
        assert drawn == (70, 40) or "font-size" in attributes


@pytest.mark.parametrize(
    "attributes",
    [
        'width="192" height="4294967296"',
        f'width="{"9" * 400}" height="5"',
        'width="1e200" height="1e200"',
        'width="0" height="5"',
        'width="-4" height="5"',
        'viewBox="0 0 1e30 1e30"',
        'viewBox="0 0 1e-300 1e300"',
    ],
)
def test_absurd_sizes_are_refused_before_drawing(attributes: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpsplat.svg.viewer.subprocess.run", None)
    with pytest.raises(ImageError, match=r"million|not positive"):
        draw_png(f"{HEAD}{attributes}>{PATH}</svg>")


def test_thin_pictures_take_no_more_than_they_are(tmp_path: Path) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text(f'{HEAD}width="1" height="60000">{PATH}</svg>')
    assert run("render", svg, "-o", tmp_path / "a.png") == 0
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (1, 60000)


def test_pillows_limit_is_not_that_of_our_pictures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    assert render_svg(f"{SMALL}{PATH}</svg>").size == (40, 30)
    assert on_white(render_own(write_svg(disc(10, 30, 15)))).shape == (30, 30, 3)


ENCODED = {
    "utf-8-sig": "",
    "utf-16": "UTF-16",
    "utf-16-le": "UTF-16",
    "utf-16-be": "UTF-16",
    "latin-1": "ISO-8859-1",
    "cp1252": "windows-1252",
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
def test_encodings_that_are_none(encoding: str, tmp_path: Path) -> None:
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
ENTITIES = {
    "laughs": f'<!DOCTYPE svg [<!ENTITY l0 "ha">{LAUGHS}]>{SMALL}<title>&l11;</title></svg>',
    "square": f'<!DOCTYPE svg [<!ENTITY a "{"a" * 50_000}">]>{SMALL}<g id="{"&a;" * 50_000}"/></svg>',
}


@pytest.mark.parametrize("name", ENTITIES)
def test_entities_that_multiply(name: str) -> None:
    with pytest.raises(ImageError, match="multiplies"):
        inspect_svg(ENTITIES[name])


def test_entities_of_drawing_programs_are_read() -> None:
    text = f'<!DOCTYPE svg [<!ENTITY c "#f00">]>{SMALL}<rect width="40" height="30" fill="&c;"/></svg>'
    assert render_svg(text).convert("RGB").getpixel((3, 3)) == (255, 0, 0)


def test_external_entities_are_not_read(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text("M0 0H40V30H0z")
    text = f'<!DOCTYPE svg [<!ENTITY x SYSTEM "{secret.as_uri()}">]>{SMALL}<path d="&x;"/></svg>'
    with pytest.raises(ImageError, match="cannot be rendered"):
        inspect_svg(text)


@pytest.mark.parametrize("text", ["", "hello", "<html/>", "<svg/>", f"{SMALL}<g></svg>", f"{SMALL}\0</svg>"])
def test_not_svg(text: str) -> None:
    with pytest.raises(ImageError, match=r"not an SVG|cannot be rendered"):
        render_svg(text)


def test_reading_is_linear() -> None:
    """Texts that a search from each position would take minutes for."""
    assert inspect_svg(f"{SMALL}<!--{'<path ' * 200_000}--></svg>").paths == 0
    assert inspect_svg(f'{SMALL}<g style="fill:{" " * 1_000_000}"/></svg>').nodes == 0
    assert path_nodes("1" * 1_000_000 + "e" * 1_000_000) == 0
    assert inspect_svg(f'{HEAD}viewBox="0{" " * 500_000}x"/>').paths == 0


@pytest.mark.parametrize(
    ("data", "count"), [("m0 0a1 1 0 012 2 1 1 0 0 0 5 5", 3), ("M1e-1 2e-5L3 4", 2), ("z", 0)]
)
def test_nodes_of_compact_data(data: str, count: int) -> None:
    assert path_nodes(data) == count


def test_outputs_that_are_no_png(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, other = tmp_path / "a.svg", tmp_path / "b.jpg"
    svg.write_text(f"{SMALL}</svg>")
    assert run("render", svg, "-o", other) == 2
    assert ".png" in one_line(capsys.readouterr().err)
    assert not other.exists()


def test_standard_streams(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    class Stdin:
        buffer = io.BytesIO(f"{SMALL}{PATH}</svg>".encode())

    image = tmp_path / "a.png"
    Image.new("RGB", (40, 30)).save(image)
    monkeypatch.setattr("sys.stdin", Stdin)
    assert run("render", "-", "-o", "-") == 0
    assert Image.open(io.BytesIO(capsysbinary.readouterr().out)).size == (40, 30)
    Stdin.buffer.seek(0)
    assert run("eval", image, "-", "--json") == 0
    assert json.loads(capsysbinary.readouterr().out)["paths"] == 1
    Stdin.buffer = io.BytesIO(b"hello")
    assert run("render", "-", "-o", "-") == 3
    assert b"standard input" in capsysbinary.readouterr().err
    assert run("eval", "-", "-") == 2


def test_an_endless_device_is_not_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if not Path("/dev/zero").exists():
        pytest.skip("no such device here")
    assert run("render", "/dev/zero", "-o", tmp_path / "a.png") == 3
    assert "device" in one_line(capsys.readouterr().err)
