"""Foreign SVGs are checked, measured and drawn without harm."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import Cli, one_line, run
from tests.scenes import disc
from tests.svg.foreign import HEAD, PATH, SMALL
from warpsplat.errors import ImageError
from warpsplat.svg import viewer
from warpsplat.svg.inspect import MAX_DEPTH, inspect_svg, svg_size
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
